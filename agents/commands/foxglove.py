"""`llrp foxglove`: a robot's topics, live, for the Foxglove app."""

import argparse

from agents.agent import joined
from agents.commands import options

_PORT = 8765


def configure(parser: argparse.ArgumentParser) -> None:
    """Its words."""
    options.add_agent(parser, "configs/thymio.toml")
    options.add_listening(parser, _PORT, "watch the robot")
    parser.epilog = (
        "In Foxglove: Open connection, Foxglove WebSocket, the address that is printed; then Layouts, Import from\n"
        "file, configs/foxglove-layout.json. Foxglove only looks: it cannot command the robot.\n\n"
        "examples:\n  llrp foxglove\n  llrp foxglove --config configs/drone.toml --port 9000"
    )


def run(arguments: argparse.Namespace) -> int:
    """Hand on until told to stop."""
    from agents.foxglove_sink import FoxgloveSink
    from agents.transport import subscribe_all

    configuration = options.load_configuration(arguments)
    with joined(configuration, "foxglove", alone=False) as agent:
        sink = FoxgloveSink(agent.robot, arguments.host, arguments.port)
        with subscribe_all(agent.session, agent.robot, sink.take) as subscription:
            print(f"{agent.robot}: ws://{arguments.host}:{sink.port}", flush=True)
            agent.stop.wait()
        sink.close()
    print(f"{sink.sent} messages; never came: {subscription.missed}")
    return 0
