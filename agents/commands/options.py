"""Options that several commands share."""

import argparse
import importlib.util
import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from agents.extras import install
from llrp_online.configuration import RobotConfiguration, load
from replay import compiling

N = TypeVar("N", int, float)
_SCENARIOS = Path("configs/scenarios")


def add_config(parser: argparse.ArgumentParser, default: str | None = None, optional: str = "") -> None:
    """--config; `optional` says what happens without it."""
    parser.add_argument(
        "--config",
        type=Path,
        required=default is None and not optional,
        default=None if default is None else Path(default),
        metavar="C.toml",
        help="the robot's configuration" + (f" (default: {default})" if default else f"; {optional}" * bool(optional)),
    )


def add_agent(parser: argparse.ArgumentParser, default: str | None = None, optional: str = "") -> None:
    """--config and --endpoint: for what lives on the bus."""
    add_config(parser, default, optional)
    parser.add_argument("--endpoint", metavar="tcp/HOST:PORT", help="where agents meet, instead of transport.endpoint")


def load_configuration(arguments: argparse.Namespace) -> RobotConfiguration:
    """The configuration, with what the command line says instead: --endpoint, and a learner's --seed."""
    configuration = load(arguments.config)
    compiling.use(configuration.compute.compiled)
    if getattr(arguments, "endpoint", None):
        transport = configuration.transport.model_copy(update={"endpoint": arguments.endpoint})
        configuration = configuration.model_copy(update={"transport": transport})
    asked = {key: getattr(arguments, f"thymio_{key}", None) for key in ("port", "camera")}
    if given := {key: value for key, value in asked.items() if value is not None}:
        thymio = configuration.thymio.model_copy(update=given)
        configuration = configuration.model_copy(update={"thymio": thymio})
    if arguments.command == "learn" and arguments.seed is not None:
        training = configuration.training.model_copy(update={"seed": arguments.seed})
        configuration = configuration.model_copy(update={"training": training})
    return configuration


def add_recordings(parser: argparse.ArgumentParser) -> None:
    """RECORDING..."""
    parser.add_argument(
        "recordings", type=Path, nargs="+", metavar="RECORDING", help="MCAP files or bags, one trajectory each"
    )


def add_checkpoint(parser: argparse.ArgumentParser) -> None:
    """CKPT."""
    parser.add_argument("checkpoint", type=Path, metavar="CKPT", help="directory with weights.safetensors")


def add_json(parser: argparse.ArgumentParser) -> None:
    """--json."""
    parser.add_argument("--json", action="store_true", help="print one JSON object on standard output, nothing else")


def add_output(parser: argparse.ArgumentParser, what: str) -> None:
    """--output."""
    parser.add_argument("--output", type=Path, required=True, help=what)


def make_folder(folder: Path) -> None:
    """The folder that a command will write in, made now: what cannot be written is an error before the work."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(f"{folder}: cannot be made a folder to write in: {error.strerror}") from error
    if not os.access(folder, os.W_OK):
        raise ValueError(f"{folder}: cannot be written in: no right to")


def make_room(file: Path) -> None:
    """The folder of a file that a command will write; a folder in the file's place is an error before the work."""
    make_folder(file.parent)
    if file.is_dir():
        raise ValueError(f"{file}: cannot be written: it is a folder; name a file in it")


def add_minutes(parser: argparse.ArgumentParser, default: float, what: str) -> None:
    """--minutes."""
    shown = "no end" if math.isinf(default) else f"{default:g}"
    parser.add_argument("--minutes", type=positive, default=default, help=f"{what} (default: {shown})")


def add_listening(parser: argparse.ArgumentParser, port: int, exposed: str) -> None:
    """--host and --port, of what serves people; `exposed` says what whoever reaches it can do."""
    parser.add_argument(
        "--host",
        default="127.0.0.1",
        metavar="ADDRESS",
        help=f"listen on this address; any but loopback lets whoever reaches it {exposed} (default: 127.0.0.1)",
    )
    parser.add_argument("--port", type=whole(0, 65535), default=port, help=f"0: any that is free (default: {port})")


def add_port(parser: argparse.ArgumentParser) -> None:
    """--port, of a real Thymio."""
    parser.add_argument(
        "--port", dest="thymio_port", metavar="PORT", help="/dev/ttyACM0 or tcp/HOST:PORT, instead of [thymio] port"
    )


def need_thymio() -> None:
    """RuntimeError that says what to install, where the extra `thymio` is not."""
    if importlib.util.find_spec("thymiodirect") is None or importlib.util.find_spec("serial") is None:
        raise RuntimeError(f"a real Thymio needs pyserial and thymiodirect: {install('thymio')}")


def add_world(parser: argparse.ArgumentParser) -> None:
    """--scenario and --seed."""
    parser.add_argument(
        "--scenario",
        type=scenario_path,
        default=scenario_path("tiles"),
        help="a name from configs/scenarios, or a TOML file (default: tiles)",
    )
    parser.add_argument("--seed", type=whole(0), default=0, help="of the layout and of all noise (default 0)")


def positive(text: str) -> float:
    """A number above 0.

    >>> positive("0.5")
    0.5
    """
    value = _number(text, float)
    if not value > 0:
        raise argparse.ArgumentTypeError(f"expected a number above 0, got {text!r}")
    return value


def whole(least: int, most: int | None = None) -> Callable[[str], int]:
    """What takes whole numbers from `least` on.

    >>> whole(0)("12")
    12
    """

    def parse(text: str) -> int:
        value = _number(text, int)
        if value < least or (most is not None and value > most):
            limits = f"of at least {least}" if most is None else f"from {least} to {most}"
            raise argparse.ArgumentTypeError(f"expected a whole number {limits}, got {text!r}")
        return value

    return parse


def speed(text: str) -> float:
    """A factor, or `max` for as fast as it goes."""
    return math.inf if text == "max" else positive(text)


def _number(text: str, kind: Callable[[str], N]) -> N:
    try:
        return kind(text)
    except ValueError as error:
        what = "a whole number" if kind is int else "a number"
        raise argparse.ArgumentTypeError(f"expected {what}, got {text!r}") from error


def scenario_path(text: str) -> Path:
    """A scenario by its name in configs/scenarios, or by its file."""
    path = Path(text)
    return path if path.suffix == ".toml" else _SCENARIOS / f"{text}.toml"
