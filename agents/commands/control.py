"""`llrp control`: a controller, as an agent."""

import argparse
import math

from agents.agent import joined
from agents.behaviours import BEHAVIOURS, controller
from agents.commands import options

_LOOK_EVERY_S = 0.05
_REPORT_EVERY_LOOKS = 10


def configure(parser: argparse.ArgumentParser) -> None:
    """Its words."""
    options.add_agent(parser, "configs/thymio.toml")
    parser.add_argument("--behaviour", choices=tuple(BEHAVIOURS), default="seek", help="(default: seek)")
    parser.add_argument("--seed", type=options.whole(0), default=0, help="of its random choices (default 0)")
    options.add_minutes(parser, math.inf, "of the robot's time")
    parser.epilog = (
        "behaviours:\n"
        + "".join(f"  {name:8s} {story}\n" for name, story in BEHAVIOURS.items())
        + "\nexample:\n  llrp control --behaviour avoid"
    )


def run(arguments: argparse.Namespace) -> int:
    """Drive until told to stop, then stop the robot."""
    from agents.driver import Driver

    configuration = options.load_configuration(arguments)
    with joined(configuration, "controller") as agent:
        drives = controller(arguments.behaviour, configuration, arguments.seed)
        driver = Driver(agent, configuration, drives, arguments.behaviour)
        looks = 0
        while not agent.stop.wait(_LOOK_EVERY_S) and driver.robot_s < 60 * arguments.minutes:
            if looks % _REPORT_EVERY_LOOKS == 0:
                driver.report()
            looks += 1
        driver.close()
    return 0
