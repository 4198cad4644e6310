"""Options that several commands share."""

import argparse
from pathlib import Path


def add_config(parser: argparse.ArgumentParser, default: str | None = None) -> None:
    """--config."""
    parser.add_argument(
        "--config",
        type=Path,
        required=default is None,
        default=None if default is None else Path(default),
        metavar="C.toml",
        help="the robot's configuration" + (f" (default: {default})" if default else ""),
    )


def add_recordings(parser: argparse.ArgumentParser) -> None:
    """RECORDING..."""
    parser.add_argument("recordings", type=Path, nargs="+", metavar="RECORDING", help="MCAP files, one trajectory each")


def add_json(parser: argparse.ArgumentParser) -> None:
    """--json."""
    parser.add_argument("--json", action="store_true", help="print one JSON object on standard output, nothing else")


def add_output(parser: argparse.ArgumentParser, what: str) -> None:
    """--output."""
    parser.add_argument("--output", type=Path, required=True, help=what)
