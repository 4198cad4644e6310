"""`llrp record`: all of a robot's topics to an MCAP file; or a simulated drive, in virtual time."""

import argparse
import math
from pathlib import Path

from agents.agent import joined
from agents.behaviours import BEHAVIOURS, controller
from agents.commands import options
from agents.progress import track
from llrp_online.configuration import RobotConfiguration


def configure(parser: argparse.ArgumentParser) -> None:
    """Its words."""
    options.add_agent(parser, "configs/thymio.toml")
    options.add_output(parser, "MCAP file")
    options.add_minutes(parser, math.inf, "of the robot's time, wanted with --simulate")
    parser.add_argument(
        "--simulate", action="store_true", help="drive the simulated robot in this process: the same bytes every time"
    )
    without_predictions = tuple(name for name in BEHAVIOURS if name != "avoid")
    parser.add_argument("--behaviour", default="explore", choices=without_predictions)
    options.add_world(parser)
    parser.epilog = (
        "examples:\n"
        "  llrp record --output today.mcap                                           (until Ctrl-C)\n"
        "  llrp record --simulate --scenario wood --minutes 10 --seed 3 --output wood.mcap"
    )


def run(arguments: argparse.Namespace) -> int:
    """Record."""
    configuration = options.load_configuration(arguments)
    options.make_folder(arguments.output.parent)
    if arguments.simulate:
        if math.isinf(arguments.minutes):
            raise ValueError("--simulate needs an end: give --minutes")
        count = record_simulated(
            configuration, arguments.scenario, arguments.seed, arguments.minutes, arguments.output, arguments.behaviour
        )
        print(f"{count} messages to {arguments.output}")
        return 0
    return _record_live(configuration, arguments)


def record_simulated(
    configuration: RobotConfiguration,
    scenario: Path,
    seed: int,
    minutes: float,
    output: Path,
    behaviour: str = "explore",
) -> int:
    """Drive the simulated robot in virtual time and record what it senses; the messages written."""
    from agents import messages
    from agents.robots.wire import Wire
    from agents.rollout import rollout
    from replay.recording import Writer

    robot, wire = options.simulated_robot(configuration, scenario, seed), Wire(configuration)
    rate_hz = 0.0 if configuration.simulation is None else configuration.simulation.rate_hz
    drive = rollout(robot, controller(behaviour, configuration, seed), configuration, 60 * minutes)
    output.parent.mkdir(parents=True, exist_ok=True)
    with Writer(output, messages.definition) as writer:
        for seen in track(drive, "driving", round(60 * minutes * rate_hz)):
            for message in wire.messages(seen):
                writer.write(message)
    return writer.messages


def _record_live(configuration: RobotConfiguration, arguments: argparse.Namespace) -> int:
    from agents.recorder import Recorder

    with joined(configuration, "recorder", alone=False) as agent:
        with Recorder(agent.session, agent.robot, arguments.output) as recorder:
            while not agent.stop.wait(0.1) and recorder.error is None:
                pass
        print(f"{recorder.messages} messages to {arguments.output}")
    return 0 if recorder.error is None else 1
