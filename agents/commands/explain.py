"""`llrp explain`: for each label of one frame, which reading gave it, when, how far off, how well that is known."""

import argparse
import json
import math
import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table

from agents.commands import options
from llrp_online.configuration import RobotConfiguration
from replay.explanation import Explanation

_BITS = {1: "1", 0: "0", -1: "?"}


def configure(parser: argparse.ArgumentParser) -> None:
    """Its words."""
    parser.add_argument("recording", type=Path, metavar="RECORDING", help="an MCAP file or a bag")
    options.add_config(parser)
    parser.add_argument(
        "--at", type=float, required=True, metavar="SECONDS", help="after the first frame; the nearest frame is taken"
    )
    options.add_json(parser)
    parser.epilog = (
        "Each row of the table is a target with at least one reading within tolerance: one line a range topic.\n\n"
        "example:\n  llrp explain WALK.mcap --config configs/thymio.toml --at 42.5"
    )


def run(arguments: argparse.Namespace) -> int:
    """Explain and print."""
    from agents.explaining import as_json, explain_at

    configuration = options.load_configuration(arguments)
    found, at_s = explain_at(configuration, arguments.recording, arguments.at)
    if arguments.json:
        print(json.dumps({**as_json(configuration, found), "at_s": at_s}))
        return 0
    if found.pose is None:
        print(f"the frame at {at_s:.2f} s: odometry does not tell where it was taken, so it has no label")
        return 0
    known = int((found.labels >= 0).sum())
    print(
        f"the frame at {at_s:.2f} s, taken at x {found.pose[0]:.3f} m, y {found.pose[1]:.3f} m, "
        f"yaw {found.pose[2]:.3f} rad: {known} of {found.labels.size} labels known"
    )
    # What is read by a program or a file is not to be folded to the width of a terminal that is not there.
    console = Console(width=None if sys.stdout.isatty() else 160)
    console.print(_table(configuration, found))
    return 0


def _table(configuration: RobotConfiguration, found: Explanation) -> Table:
    table = Table("target x, y, yaw", "topic", "bits, left to right", "reading", "off", "turned", "known to", "weight")
    for topic, members in configuration.streams.items():
        first = members[0]  # what a reading is like is the same for all its sensors
        for target, (x_m, y_m, yaw_rad) in enumerate(configuration.targets.build().poses.tolist()):
            when_ns = int(found.reading_ns[target, first])
            if when_ns < 0:
                continue
            sure_m = float(found.deviation_m[target, first])
            table.add_row(
                f"{x_m:.2f} m, {y_m:.2f} m, {yaw_rad:.2f} rad",
                topic,
                " ".join(_BITS[bit] for bit in found.labels[target, members].tolist()),
                f"{(when_ns - found.t_ns) * 1e-9:+.2f} s",
                f"{1e3 * found.distance_m[target, first]:.1f} mm",
                f"{found.turned_rad[target, first]:+.3f} rad",
                "" if math.isnan(sure_m) else f"{1e3 * sure_m:.1f} mm",
                f"{found.weight[target, members].max():.2f}",
            )
    return table
