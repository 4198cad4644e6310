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
from typing import Any

from agents.usage import UsageError

#: Command -> what it does; the module of the same name has `configure(parser)` and `run(arguments) -> exit code`.
COMMANDS = {
    "demo": "the whole story: a simulated robot learns to see while it drives; ends with a report",
    "robot": "the simulated robot, or a real Thymio, as an agent",
    "calibrate": "what a real Thymio's units are in metres, from two drives and a tape measure",
    "learn": "the learner: live on a robot, or over recordings",
    "perceive": "predictions from the newest frame and the newest weights, as an agent",
    "control": "a controller: seeks what was not met yet, or drives on predictions",
    "dashboard": "what the robot sees, learns and why, in a browser, as an agent",
    "record": "write all of a robot's topics to an MCAP file; or a simulated drive, in virtual time",
    "foxglove": "a robot's topics, live, for the Foxglove app, as an agent",
    "ros2": "a ROS 2 node between a robot of any middleware and its agents",
    "play": "play a recording as if it were the robot, as an agent",
    "label": "resolve the labels of a recording",
    "explain": "why the labels of one frame are what they are: which reading gave each",
    "train": "train offline over recordings, the paper's way",
    "evaluate": "AUC of a checkpoint for every target and sensor, with intervals",
    "window": "how long your robot's odometry may be trusted, from its recordings",
    "experiment": "a study: figures, claims with intervals, a page; goes on where it stopped",
    "export": "a checkpoint's network as one ONNX file, checked, for any runtime",
    "check": "look over a recording or a live robot: clocks, frames, units, rates, ranges",
    "completion": "print what a shell must be told to complete `llrp` by the tab key",
}

#: What holds for every command.
EXIT_CODES = {
    0: "done; an agent: told to end, by Ctrl-C or SIGTERM",
    1: "could not, or the answer is no; the reason is on standard error",
    2: "wrong usage",
    130: "interrupted by Ctrl-C before it was done",
}
EXIT_CODES_TEXT = "exit codes:\n" + "\n".join(f"  {code:<4d} {meaning}" for code, meaning in EXIT_CODES.items())
_EPILOG = f"""\
examples:
  llrp demo                                                   see it all, ten robot minutes
  llrp check WALK.mcap --config configs/nao.toml              is this recording fit to learn from?
  llrp learn --recordings *.mcap --config C.toml --output RUN learn over recordings, in order
  llrp evaluate RUN/checkpoint TEST.mcap --config C.toml      how well does it see?

{EXIT_CODES_TEXT}
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
        code = int(parsed.run(parsed))
        sys.stdout.flush()  # here, where a reader that has gone is dealt with
        return code
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        # Python flushes once more at its end, and would complain of the same again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except UsageError as error:
        print(f"llrp {command}: {error}", file=sys.stderr)
        return 2
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


def whole_parser() -> argparse.ArgumentParser:
    """The parser with the words of every command; it loads them all."""
    return _parser(*COMMANDS)


def _parser(*loaded: str | None) -> argparse.ArgumentParser:
    """The parser with the words of these commands, and the names of the others."""
    parser = argparse.ArgumentParser(
        prog="llrp",
        description="A robot that learns to see far by driving.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action=_Version, help="print the version and end")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, story in COMMANDS.items():
        sub = commands.add_parser(
            name, help=story, description=story, formatter_class=argparse.RawDescriptionHelpFormatter
        )
        if name in loaded:  # loading the others would cost a second that `llrp --help` should not take
            module = importlib.import_module(f"agents.commands.{name}")
            module.configure(sub)
            sub.set_defaults(run=module.run)
            sub.epilog = f"{sub.epilog}\n\n{EXIT_CODES_TEXT}"
    return parser


class _Version(argparse.Action):
    """Looks the version up only when it is asked for: that takes longer than all the rest of `llrp --help`."""

    def __init__(self, option_strings: Sequence[str], dest: str, **others: Any) -> None:
        super().__init__(option_strings, dest, nargs=0, default=argparse.SUPPRESS, **others)

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from importlib.metadata import version

        print(f"llrp-online {version('llrp-online')}")
        parser.exit()


if __name__ == "__main__":
    sys.exit(main())
