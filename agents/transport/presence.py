"""Who is there: a token an agent, which goes when its process does."""

from collections.abc import Callable

import zenoh

from agents.transport.session import key
from agents.transport.subscribe import Drain

_FOLDER = "live"
_WAITING = 256


def announce(session: zenoh.Session, robot: str, agent: str) -> zenoh.LivelinessToken:
    """Says that `agent` is there until the token is undeclared, the session closes or the process dies."""
    return session.liveliness().declare_token(key(robot, f"{_FOLDER}/{agent}"))


def present(session: zenoh.Session, robot: str, timeout_s: float = 1.0) -> set[str]:
    """Names of the agents that are there now."""
    replies = session.liveliness().get(key(robot, _FOLDER) + "/*", timeout=timeout_s)
    return {_agent(reply.ok) for reply in replies if reply.ok is not None}


def watch(session: zenoh.Session, robot: str, handler: Callable[[str, bool], None]) -> Drain:
    """Calls `handler(agent, is_there)` for each that is there and whenever one comes or goes."""
    declared = session.liveliness().declare_subscriber(
        key(robot, _FOLDER) + "/*", zenoh.handlers.FifoChannel(_WAITING), history=True
    )

    def take(sample: zenoh.Sample) -> None:
        handler(_agent(sample), sample.kind == zenoh.SampleKind.PUT)

    return Drain(declared, take, f"presence {robot}")


def _agent(sample: zenoh.Sample) -> str:
    return str(sample.key_expr).rsplit("/", 1)[-1]
