"""`llrp demo`: a simulated robot learns to see while it drives, then drives on what it sees; ends with a report."""

import argparse
import importlib.util
import json
import signal
import sys
from pathlib import Path

from agents.commands import options
from agents.demo.reporting import report
from agents.demo.show import Plan, show
from agents.ending import ended_by_signals
from agents.run_folder import RunFolder


def configure(parser: argparse.ArgumentParser) -> None:
    """Its words."""
    options.add_config(parser, "configs/thymio.toml")
    options.add_world(parser)
    options.add_minutes(parser, 10.0, "of exploring, the robot's time")
    parser.add_argument(
        "--drive-minutes",
        type=options.positive,
        default=2.0,
        help="of driving on predictions alone afterwards (default 2)",
    )
    parser.add_argument(
        "--speed", type=options.speed, default=4.0, help="of the robot's time; `max`: as fast as it goes (default 4)"
    )
    parser.add_argument("--output", type=Path, metavar="RUN", help="folder (default: runs/demo-SCENARIO-SEED)")
    parser.add_argument(
        "--held-out-minutes",
        type=options.positive,
        default=5.0,
        help="length of the held-out drive it is judged on (default 5)",
    )
    parser.add_argument("--no-dashboard", action="store_true", help="nothing to watch in a browser")
    options.add_json(parser)
    parser.epilog = (
        "examples:\n  llrp demo\n  llrp demo --minutes 2 --scenario wood\n  llrp demo --minutes 30 --speed max --seed 3"
    )


def has_dashboard() -> bool:
    """Is the extra `dashboard` installed?"""
    return all(importlib.util.find_spec(name) is not None for name in ("starlette", "uvicorn", "websockets"))


def run(arguments: argparse.Namespace) -> int:
    """Show, then report."""
    configuration = options.load_configuration(arguments)
    output = arguments.output or Path("runs") / f"demo-{arguments.scenario.stem}-{arguments.seed}"
    plan = Plan(
        arguments.config,
        arguments.scenario,
        arguments.seed,
        arguments.minutes,
        arguments.drive_minutes,
        arguments.speed,
        output,
        dashboard=not arguments.no_dashboard and has_dashboard(),
    )
    if plan.recording.exists():
        raise ValueError(
            f"{output}: holds a run already, which is never overwritten; remove it or give another --output"
        )
    options.make_folder(output)
    with ended_by_signals() as stop:
        outcome = show(plan, configuration, stop)
    if stop.is_set():
        learned = RunFolder(output, []).checkpoint
        kept = f"what was learned until then is in {learned}" if learned.exists() else "nothing was learned yet"
        print(f"stopped; {kept}", file=sys.stderr)
        return 130
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.default_int_handler)
    curve, page = report(plan, configuration, outcome, arguments.held_out_minutes)
    if arguments.json:
        print(json.dumps({"report": str(page), "learning_curve": [point.as_json() for point in curve]}))
        return 0
    for point in curve:
        print(point)
    print(f"report: {page}")
    return 0
