"""`llrp dashboard`: what a robot sees, learns and why, in a browser, as an agent."""

import argparse
import ipaddress
import sys
from pathlib import Path

from agents.agent import joined
from agents.commands import options
from agents.extras import install

_LOOK_EVERY_S = 0.2
_PORT = 8080


def configure(parser: argparse.ArgumentParser) -> None:
    """Its words."""
    options.add_agent(parser, "configs/thymio.toml")
    options.add_listening(parser, _PORT, "watch and stop the robot")
    parser.add_argument(
        "--save-to",
        type=Path,
        default=Path("runs/saved"),
        metavar="FOLDER",
        help="the Save button's checkpoints go there, on the learner's machine (default: runs/saved)",
    )
    parser.epilog = (
        f"Needs the extra `dashboard`: {install('dashboard')}.\n\n"
        "examples:\n"
        "  llrp dashboard\n"
        "  llrp dashboard --host 0.0.0.0    (to watch on a phone beside the robot, in a network you trust)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Serve until told to stop."""
    try:
        from agents.dashboard.button import StopButton
        from agents.dashboard.collector import Collector
        from agents.dashboard.server import Dashboard
    except ImportError as error:
        if error.name is None or error.name.split(".")[0] not in ("starlette", "uvicorn", "websockets"):
            raise
        raise RuntimeError(f"{error.name} is not installed: {install('dashboard')}") from error

    configuration = options.load_configuration(arguments)
    with joined(configuration, "dashboard", alone=False) as agent:
        collector = Collector(agent, configuration)
        button = StopButton(agent, configuration, lambda: collector.ground.now_ns)
        with Dashboard(collector, button, arguments.host, arguments.port, arguments.save_to) as dashboard:
            print(f"dashboard: {url(arguments.host, dashboard.port)}", flush=True)
            if not _is_loopback(arguments.host):
                print(
                    f"warning: whoever reaches {arguments.host} can watch the robot, stop it, and pause what it "
                    "learns; there is no password. Do this in a network you trust.",
                    file=sys.stderr,
                    flush=True,
                )
            while not agent.stop.wait(_LOOK_EVERY_S) and dashboard.failure is None:
                pass
        if collector.stopped:
            print("the robot stays stopped: start the dashboard again, press Stop, then Release", file=sys.stderr)
        collector.close()
    if dashboard.failure is not None:
        raise RuntimeError(f"the dashboard has failed: {dashboard.failure!r}") from dashboard.failure
    return 0


def url(host: str, port: int) -> str:
    """Where a browser on this machine finds it.

    >>> url("0.0.0.0", 8080), url("::1", 80)
    ('http://127.0.0.1:8080/', 'http://[::1]:80/')
    """
    name = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, host)
    return f"http://{f'[{name}]' if ':' in name else name}:{port}/"


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
