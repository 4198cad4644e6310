"""A drive through ROS 2, and the predictions that come back. What runs beside it is in docs/ros2.md.

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
    """Print what is expected at the nearest target: four columns say where it is, the others are sensors."""
    points = np.frombuffer(bytes(cloud.data), np.float32).reshape(cloud.width, len(cloud.fields))
    print("prediction", cloud.header.stamp.sec * 10**9 + cloud.header.stamp.nanosec, points[0, 4:].round(2), flush=True)


rclpy.init()
node = rclpy.create_node("drive")
types = {"/odom": Odometry, "/range": LaserScan, "/camera/image/compressed": CompressedImage}
publishers = {topic: node.create_publisher(kind, topic, 10) for topic, kind in types.items()}
node.create_subscription(PointCloud2, "/prediction", see, 10)
node.create_subscription(Twist, "/cmd_vel", lambda twist: print("command", twist.linear.x, twist.angular.z), 10)
while not all(publisher.get_subscription_count() for publisher in publishers.values()):
    rclpy.spin_once(node, timeout_sec=0.1)  # until `llrp ros2` has found us
begin_s = time.monotonic()
for message in read(sys.argv[1]):
    while (wait_s := begin_s + message.log_ns / 1e9 - time.monotonic()) > 0:
        rclpy.spin_once(node, timeout_sec=wait_s)
    publishers[message.topic.removeprefix("/thymio")].publish(message.data)
while time.monotonic() - begin_s < message.log_ns / 1e9 + 1.0:
    rclpy.spin_once(node, timeout_sec=0.1)
