"""A robot of any ROS 2 middleware: a node that hands its messages to agents and theirs to it, byte for byte.

For robots that run neither rmw_zenoh nor zenoh-bridge-ros2dds; those need no node, see `[keys] mapping`.
"""

from agents.robots.ros2.node import RosNode

__all__ = ["RosNode"]
