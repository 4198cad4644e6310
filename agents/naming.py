"""The dialect that a robot's configuration asks for."""

from agents import messages, topics
from agents.transport import Naming, Plain, Ros2Dds, Ros2Zenoh, key
from llrp_online.configuration import RobotConfiguration


def naming_of(configuration: RobotConfiguration) -> Naming:
    """What the robot's topics are called on the wire.

    >>> from pathlib import Path
    >>> from llrp_online.configuration import load
    >>> naming_of(load(Path("configs/thymio.toml"))).subscribed("thymio/odom")
    'thymio/odom'
    """
    robot, keys = configuration.robot.name, configuration.keys
    types = {key(robot, topic): kind for topic, kind in {**topics.SPOKEN, **topics.sensed(configuration)}.items()}
    if keys.mapping == "ros2-zenoh":
        return Ros2Zenoh(robot, types, messages.type_hash, keys.domain, keys.namespace)
    if keys.mapping == "ros2-dds":
        return Ros2Dds(robot, types, keys.namespace)
    return Plain(types)
