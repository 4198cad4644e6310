"""The same as ros2_rclpy.py with zenoh-ros2-sdk, which speaks rmw_zenoh itself: no `llrp ros2`, but `[keys] mapping`.

python examples/ros2_zenoh_sdk.py DRIVE.mcap 127.0.0.1 7447
"""

import sys
import time
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore
from zenoh_ros2_sdk import ROS2Publisher, ROS2Subscriber

from replay.recording import read

PATH, HOST, PORT = sys.argv[1], sys.argv[2], int(sys.argv[3])
STORE = get_typestore(Stores.ROS2_JAZZY)


def told(topic: str, kind: str) -> dict[str, Any]:
    """What the library would otherwise fetch from the network: definition and hash of a type."""
    definition = STORE.generate_msgdef(kind, ros_version=2)[0]
    fields = {"topic": topic, "msg_type": kind, "router_ip": HOST, "router_port": PORT}
    return {**fields, "msg_definition": definition, "type_hash": STORE.hash_rihs01(kind)}


def see(cloud: Any) -> None:
    """Print what is expected at the nearest target."""
    points = np.frombuffer(bytes(cloud.data), np.float32).reshape(cloud.width, len(cloud.fields))
    t_ns = cloud.header.stamp.sec * 10**9 + cloud.header.stamp.nanosec
    print(f"prediction {t_ns} {points[0, 4:].round(2)}\n", end="", flush=True)


def obey(twist: Any) -> None:
    """Print commands."""
    print(f"command {twist.linear.x} {twist.angular.z}\n", end="", flush=True)


listening = [
    ROS2Subscriber(**told("/prediction", "sensor_msgs/msg/PointCloud2"), callback=see),
    ROS2Subscriber(**told("/cmd_vel", "geometry_msgs/msg/Twist"), callback=obey),
]
types = {
    "/odom": "nav_msgs/msg/Odometry",
    "/range": "sensor_msgs/msg/LaserScan",
    "/camera/image/compressed": "sensor_msgs/msg/CompressedImage",
}
publishers = {topic: ROS2Publisher(**told(topic, kind)) for topic, kind in types.items()}
time.sleep(1.0)  # until the agents have found us
begin_s = time.monotonic()
for message in read(PATH):
    time.sleep(max(0.0, begin_s + message.log_ns / 1e9 - time.monotonic()))
    decoded: Any = STORE.deserialize_cdr(message.data, message.type)
    fields = {name: value for name, value in vars(decoded).items() if name != "__msgtype__"}
    publishers[message.topic.removeprefix("/thymio")].publish(**fields)
time.sleep(1.0)
for end in [*publishers.values(), *listening]:
    end.close()
