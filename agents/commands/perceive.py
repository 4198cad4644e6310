"""`llrp perceive`: predictions from the newest frame and the newest weights, as an agent."""

import argparse
import os

from agents.agent import joined
from agents.commands import options

_STATUS_EVERY_S = 0.5


def configure(parser: argparse.ArgumentParser) -> None:
    """Its words."""
    options.add_agent(parser, "configs/thymio.toml")
    parser.add_argument(
        "--realtime", action="store_true", help="ask for real-time priority, so that nothing else delays a frame"
    )
    parser.epilog = "example:\n  llrp perceive --config configs/thymio.toml"


def run(arguments: argparse.Namespace) -> int:
    """Perceive until told to stop."""
    from agents.perceiver import Perceiver

    configuration = options.load_configuration(arguments)
    if arguments.realtime:
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
        except PermissionError as error:
            raise RuntimeError("--realtime needs the right to it: run with CAP_SYS_NICE, or leave it out") from error
    with joined(configuration, "perceiver") as agent:
        perceiver = Perceiver(agent, configuration)
        while not agent.stop.wait(_STATUS_EVERY_S):
            perceiver.report()
        perceiver.close()
        figures = perceiver.figures()
    times = f"p50 {figures.p50_ms:.2f} ms, p99 {figures.p99_ms:.2f} ms, p99.9 {figures.p999_ms:.2f} ms"
    print(f"{figures.frames} predictions" + (f"; frame to prediction: {times}" if figures.frames else ""))
    for what, count in figures.drops.items():
        print(f"dropped {count}: {what}")
    return 0
