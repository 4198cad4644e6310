"""`llrp play`: a recording as if it were the robot."""

import argparse
from pathlib import Path

from agents.agent import joined
from agents.commands import options
from agents.progress import share_of


def configure(parser: argparse.ArgumentParser) -> None:
    """Its words."""
    parser.add_argument("recording", type=Path, metavar="RECORDING.mcap")
    options.add_agent(parser)
    parser.add_argument("--speed", type=options.speed, default=1.0, help="of the recording; `max`: as fast as it goes")
    parser.epilog = "example:\n  llrp play WALK.mcap --config configs/nao.toml --speed 5"


def run(arguments: argparse.Namespace) -> int:
    """Play to the end, or until told to stop."""
    from agents.robots.playback import Playback

    configuration = options.load_configuration(arguments)
    with joined(configuration, "robot") as agent:
        playback = Playback(agent.session, configuration, arguments.recording, arguments.speed)
        with share_of("playing") as told:
            missing = playback.run(agent.stop, told)
    print(f"{playback.played} messages played")
    return 0 if missing is None else 1
