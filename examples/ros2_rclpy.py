"""A drive through ROS 2, and the predictions that come back. Needs rclpy; see docs/ros2.md for what runs beside it.

python examples/ros2_rclpy.py DRIVE.mcap
"""

import sys
import time

import numpy as np
import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CompressedImage, LaserScan, PointCloud2

from replay.recording import read


def see(cloud: PointCloud2) -> None:
    """Print, for each sensor, the most that is expected of it anywhere ahead."""
    names = [field.name for field in cloud.fields]
    points = np.frombuffer(bytes(cloud.data), np.float32).reshape(cloud.width, len(names))
    most = {name: round(float(points[:, i].max()), 2) for i, name in enumerate(names) if name not in "x y z yaw"}
    print(
        f"prediction {cloud.header.stamp.sec}.{cloud.header.stamp.nanosec:09d} {len(points)} targets {most}", flush=True
    )


rclpy.init()
node = rclpy.create_node("drive")
types = {"/odom": Odometry, "/range": LaserScan, "/camera/image/compressed": CompressedImage}
publishers = {topic: node.create_publisher(kind, topic, 10) for topic, kind in types.items()}
node.create_subscription(PointCloud2, "/prediction", see, 100)
node.create_subscription(Twist, "/cmd_vel", lambda twist: print(f"command {twist.linear.x} {twist.angular.z}"), 10)
while any(publisher.get_subscription_count() == 0 for publisher in publishers.values()):
    rclpy.spin_once(node, timeout_sec=0.1)  # until `llrp ros2` has found us
begin_s = time.monotonic()
for message in read(sys.argv[1]):
    topic = message.topic.removeprefix("/thymio")
    while (wait_s := begin_s + message.log_ns / 1e9 - time.monotonic()) > 0:
        rclpy.spin_once(node, timeout_sec=wait_s)
    if topic in publishers:
        publishers[topic].publish(message.data)
end_s = time.monotonic() + 1.0
while time.monotonic() < end_s:
    rclpy.spin_once(node, timeout_sec=0.1)
