"""`llrp robot`: the simulated robot, as an agent."""

import argparse
import math

from agents.agent import joined
from agents.commands import options


def configure(parser: argparse.ArgumentParser) -> None:
    """Its words."""
    options.add_agent(parser, "configs/thymio.toml")
    options.add_world(parser)
    options.add_minutes(parser, math.inf, "of the robot's time")
    parser.add_argument(
        "--speed", type=options.speed, default=1.0, help="of its time; `max`: as fast as it goes (default 1)"
    )
    parser.epilog = "example:\n  llrp robot --scenario configs/scenarios/wood.toml --speed 2"


def run(arguments: argparse.Namespace) -> int:
    """Live."""
    from agents.robots.live import LiveRobot
    from agents.robots.simulated import load_scenario
    from agents.simulated_drive import simulated_robot

    configuration = options.load_configuration(arguments)
    robot = simulated_robot(configuration, load_scenario(arguments.scenario), arguments.seed)
    with joined(configuration, "robot") as agent:
        live = LiveRobot(agent, configuration, robot, arguments.speed)
        live.run(60 * arguments.minutes)
        figures = live.status
    print(f"{figures.robot_s / 60:.1f} robot minutes, {figures.metres:.1f} m, {figures.collisions} collisions")
    return 0
