"""`llrp record`: all of a robot's topics to an MCAP file; or a simulated drive, in virtual time."""

import argparse
import math

from agents.agent import joined
from agents.behaviours import BEHAVIOURS
from agents.commands import options
from agents.progress import counter
from agents.usage import UsageError
from llrp_online.configuration import RobotConfiguration

_LOOK_EVERY_S = 0.1


def configure(parser: argparse.ArgumentParser) -> None:
    """Its words."""
    options.add_agent(parser, "configs/thymio.toml")
    options.add_output(parser, "MCAP file")
    options.add_minutes(parser, math.inf, "of the robot's time; wanted with --simulate")
    parser.add_argument(
        "--simulate", action="store_true", help="drive the simulated robot in this process: the same bytes every time"
    )
    without_predictions = tuple(name for name in BEHAVIOURS if name != "avoid")
    parser.add_argument("--behaviour", default="seek", choices=without_predictions, help="(default: seek)")
    options.add_world(parser)
    parser.epilog = (
        "examples:\n"
        "  llrp record --output today.mcap    (until Ctrl-C)\n"
        "  llrp record --output walk.mcap --minutes 10\n"
        "  llrp record --simulate --scenario wood --minutes 10 --seed 3 --output wood.mcap"
    )


def run(arguments: argparse.Namespace) -> int:
    """Record."""
    configuration = options.load_configuration(arguments)
    options.make_folder(arguments.output.parent)
    if arguments.simulate:
        if math.isinf(arguments.minutes):
            raise UsageError("--simulate needs an end: give --minutes")
        from agents.robots.simulated import load_scenario
        from agents.simulated_drive import record_drive

        scenario, seed, minutes = load_scenario(arguments.scenario), arguments.seed, arguments.minutes
        count = record_drive(configuration, scenario, seed, minutes, arguments.output, arguments.behaviour)
        print(f"{count} messages to {arguments.output}")
        return 0
    return _record_live(configuration, arguments)


def _record_live(configuration: RobotConfiguration, arguments: argparse.Namespace) -> int:
    from agents.recorder import Recorder

    with joined(configuration, "recorder", alone=False) as agent:
        with (
            Recorder(agent.session, agent.robot, arguments.output) as recorder,
            counter("recording, messages") as count,
        ):
            while not agent.stop.wait(_LOOK_EVERY_S) and recorder.error is None:
                count(recorder.messages)
                if recorder.recorded_s >= 60 * arguments.minutes:
                    break
        print(f"{recorder.messages} messages to {arguments.output}")
    return 0 if recorder.error is None else 1
