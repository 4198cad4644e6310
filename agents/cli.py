"""The command line `llrp`: one word, one module of `agents.commands`, loaded only when it is asked for."""

import argparse
import atexit
import gc
import importlib
import logging
import os
import signal
import sys
import threading
from collections.abc import Generator, Sequence
from contextlib import contextmanager

#: Command -> what it does; the module of the same name has `configure(parser)` and `run(arguments) -> exit code`.
COMMANDS = {
    "demo": "the whole story: a simulated robot learns to see while it drives; ends with a report",
    "robot": "the simulated robot, as an agent",
    "learn": "the learner: live on a robot, or over recordings",
    "perceive": "predictions from the newest frame and the newest weights, as an agent",
    "control": "a controller: explore, random walk, or driving on predictions alone, as an agent",
    "record": "write all of a robot's topics to an MCAP file; or a simulated drive, in virtual time",
    "ros2": "a ROS 2 node between a robot and its agents, for any ROS 2 middleware",
    "play": "play a recording as if it were the robot, as an agent",
    "label": "resolve the labels of a recording",
    "train": "train offline over recordings, the paper's way",
    "evaluate": "AUC of a checkpoint for every target and sensor, with intervals",
    "window": "how long your robot's odometry may be trusted, from its recordings",
    "experiment": "a study: figures, claims with intervals, a page; goes on where it stopped",
    "check": "look over a recording or a live robot: clocks, frames, units, rates, ranges",
}

_EPILOG = """\
examples:
  llrp demo                                                   see it all, ten robot minutes
  llrp check WALK.mcap --config configs/nao.toml              is this recording fit to learn from?
  llrp learn --recordings *.mcap --config C.toml --output RUN learn over recordings, in order
  llrp evaluate RUN/checkpoint TEST.mcap --config C.toml      how well does it see?

exit codes: 0 done, 1 could not (the reason is on standard error), 2 wrong usage, 130 interrupted
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run `llrp` with these words; the exit code."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    command = next((word for word in words if word in COMMANDS), None)
    # The interpreter's last search for garbage takes a second or two with PyTorch loaded; agents are to end in two.
    atexit.register(gc.freeze)
    try:
        with _ended_at_once():
            parser = _parser(command)
        parsed = parser.parse_args(words)
        logging.basicConfig(level=logging.WARNING, format=f"llrp {parsed.command}: %(message)s", stream=sys.stderr)
        return int(parsed.run(parsed))
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        return 1
    except OSError as error:
        named = error.filename is not None and error.strerror is not None
        print(f"llrp {command}: {f'{error.filename}: {error.strerror}' if named else error}", file=sys.stderr)
        return 1
    except (ValueError, RuntimeError) as error:
        print(f"llrp {command}: {error}", file=sys.stderr)
        return 1


@contextmanager
def _ended_at_once() -> Generator[None]:
    """Ctrl-C ends the process on the spot: a library cut off in its import may make any other error of it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, lambda _number, _frame: os._exit(130))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _parser(command: str | None) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="llrp",
        description="A robot that learns to see far by driving.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, story in COMMANDS.items():
        sub = commands.add_parser(
            name, help=story, description=story, formatter_class=argparse.RawDescriptionHelpFormatter
        )
        if name == command:  # loading the others would cost a second that `llrp --help` should not take
            module = importlib.import_module(f"agents.commands.{name}")
            module.configure(sub)
            sub.set_defaults(run=module.run)
    return parser


if __name__ == "__main__":
    sys.exit(main())
