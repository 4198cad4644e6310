"""`llrp robot`: the simulated robot, or a real Thymio, as an agent."""

import argparse
import logging
import math

from agents.agent import joined
from agents.commands import options
from llrp_online.configuration import RobotConfiguration


def configure(parser: argparse.ArgumentParser) -> None:
    """Its words."""
    options.add_agent(parser, "configs/thymio.toml")
    parser.add_argument(
        "--kind",
        choices=("simulated", "thymio"),
        default="simulated",
        help="what kind of robot: simulated, or a real Thymio (default: simulated)",
    )
    options.add_minutes(parser, math.inf, "of the robot's time")
    options.add_world(parser)
    parser.add_argument(
        "--speed", type=options.speed, default=1.0, help="of its time; `max`: as fast as it goes (default 1)"
    )
    options.add_port(parser)
    parser.add_argument(
        "--camera",
        dest="thymio_camera",
        metavar="SOURCE",
        help="a number, a file or an address, instead of [thymio] camera; '' for none",
    )
    parser.epilog = (
        "--scenario, --seed and --speed are the simulated robot's, --port and --camera the Thymio's.\n\n"
        "examples:\n"
        "  llrp robot --scenario configs/scenarios/wood.toml --speed 2\n"
        "  llrp robot --kind thymio --port /dev/ttyACM0 --camera 0"
    )


def run(arguments: argparse.Namespace) -> int:
    """Live."""
    configuration = options.load_configuration(arguments)
    return (_simulated if arguments.kind == "simulated" else _thymio)(arguments, configuration)


def _simulated(arguments: argparse.Namespace, configuration: RobotConfiguration) -> int:
    from agents.robots.live import LiveRobot
    from agents.robots.simulated import load_scenario
    from agents.simulated_drive import simulated_robot

    robot = simulated_robot(configuration, load_scenario(arguments.scenario), arguments.seed)
    with joined(configuration, "robot") as agent:
        live = LiveRobot(agent, configuration, robot, arguments.speed)
        live.run(60 * arguments.minutes)
        figures = live.status
    print(f"{figures.robot_s / 60:.1f} robot minutes, {figures.metres:.1f} m, {figures.collisions} collisions")
    return 0


def _thymio(arguments: argparse.Namespace, configuration: RobotConfiguration) -> int:
    options.need_thymio()
    from agents.robots.thymio.live import LiveThymio

    logging.getLogger().setLevel(logging.INFO)  # that it is found, and lost, and found again, is what one waits for
    with joined(configuration, "robot") as agent:
        live = LiveThymio(agent, configuration)
        live.run(60 * arguments.minutes)
        figures = live.status
    print(f"{figures.robot_s / 60:.1f} minutes, {figures.metres:.1f} m")
    return 0
