"""`llrp ros2`: a ROS 2 node beside the agents, for a robot of any ROS 2 middleware."""

import argparse

from agents.agent import joined
from agents.commands import options
from agents.extras import install


def configure(parser: argparse.ArgumentParser) -> None:
    """Its words."""
    options.add_agent(parser)
    parser.epilog = (
        f"Wants rclpy: source ROS 2 first, or\n{install('ros')}.\nA robot that speaks rmw_zenoh or runs "
        "zenoh-bridge-ros2dds needs no node: set `[keys] mapping` instead.\n\n"
        "example:\n  llrp ros2 --config configs/turtlebot4.toml"
    )


def run(arguments: argparse.Namespace) -> int:
    """Hand messages over until told to stop."""
    from agents.robots.ros2 import RosNode

    configuration = options.load_configuration(arguments)
    if configuration.keys.mapping != "plain":
        raise ValueError(
            f"keys.mapping = {configuration.keys.mapping!r}: agents speak to ROS 2 themselves then, and would hear "
            "everything twice; leave `mapping` out with `llrp ros2`, or do without it"
        )
    with joined(configuration, "ros2") as agent:
        node = RosNode(agent, configuration)
        node.run()
        node.close()
    for topic in node.silent:
        print(f"{topic}: nobody published it")
    for topic, count in sorted(node.handed.items()):
        print(f"{topic}: {count} messages handed over")
    return 0
