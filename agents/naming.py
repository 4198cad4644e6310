"""The dialect that a robot's configuration asks for."""

import os

from agents import messages, topics
from agents.transport import Naming, Plain, Ros2Dds, Ros2Zenoh, RosNames, key
from llrp_online.configuration import RobotConfiguration


def domain_of(configuration: RobotConfiguration) -> int:
    """The ROS 2 domain; ValueError where ROS_DOMAIN_ID is asked and is no number."""
    if configuration.keys.domain is not None:
        return configuration.keys.domain
    said = os.environ.get("ROS_DOMAIN_ID", "").strip() or "0"
    if not said.isdecimal():
        raise ValueError(f"ROS_DOMAIN_ID is {said!r}; expected a number from 0 to 232, or give `[keys] domain`")
    return int(said)


def ros_names(configuration: RobotConfiguration) -> RosNames:
    """What ROS 2 calls the robot's topics."""
    keys = configuration.keys
    return RosNames(configuration.robot.name, keys.namespace, {topics.COMMAND: keys.command_topic})


def types_of(configuration: RobotConfiguration) -> dict[str, str]:
    """The ROS types of all topics that agents take in or send, by key."""
    types = {**topics.spoken(configuration), **topics.sensed(configuration)}
    return {key(configuration.robot.name, topic): type_name for topic, type_name in types.items()}


def naming_of(configuration: RobotConfiguration) -> Naming:
    """What the robot's topics are called on the wire.

    >>> from pathlib import Path
    >>> from llrp_online.configuration import load
    >>> naming_of(load(Path("configs/thymio.toml"))).subscribed("thymio/odom")
    'thymio/odom'
    """
    keys, types = configuration.keys, types_of(configuration)
    if keys.mapping == "ros2-zenoh":
        return Ros2Zenoh(ros_names(configuration), types, messages.type_hash, domain_of(configuration))
    if keys.mapping == "ros2-dds":
        return Ros2Dds(ros_names(configuration), types)
    return Plain(types)
