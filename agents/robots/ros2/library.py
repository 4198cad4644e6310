"""rclpy, where it is installed: from ROS 2 itself on a robot, from PyPI (extra `ros`) elsewhere."""

import importlib
from typing import Any

from agents.extras import install


class RosMissingError(RuntimeError):
    """A part of ROS 2 that is not installed; the message says how to get it."""


def load(module: str) -> Any:
    """A module of ROS 2; RosMissingError says how to get it."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        raise RosMissingError(
            f"{package} is not installed here ({error}): source the ROS 2 workspace that has it, such as "
            f"`. /opt/ros/jazzy/setup.sh`, in an environment of that Python; or {install('ros')}"
        ) from error


def message_class(type_name: str) -> Any:
    """The class of a type such as `nav_msgs/msg/Odometry`; RosMissingError says how to get it."""
    package, kind, name = type_name.split("/")
    try:
        return getattr(load(f"{package}.{kind}"), name)
    except AttributeError as error:
        raise RosMissingError(f"{type_name}: {package} is installed, but has no such type") from error
