"""Who is there: a token an agent, which goes when its process does."""

import time
from collections.abc import Callable

import zenoh

from agents.transport.session import Session, key
from agents.transport.subscribe import Drain

_FOLDER = "live"
_WAITING = 256


def announce(session: Session, robot: str, agent: str, since_ns: int | None = None) -> zenoh.LivelinessToken:
    """Says that `agent` is there until the token is undeclared, the session closes or the process dies.

    `since_ns`, the wall clock's time when it began, tells two of one name apart; left out, it is now.
    """
    since_ns = time.time_ns() if since_ns is None else since_ns
    return session.zenoh.liveliness().declare_token(key(robot, f"{_FOLDER}/{agent}/{since_ns}"))


def present(session: Session, robot: str, timeout_s: float = 1.0) -> set[str]:
    """Names of the agents that are there now."""
    replies = session.zenoh.liveliness().get(key(robot, _FOLDER) + "/*/*", timeout=timeout_s)
    return {_agent(reply.ok)[0] for reply in replies if reply.ok is not None}


def watch(session: Session, robot: str, handler: Callable[[str, bool], None]) -> Drain:
    """Calls `handler(agent, is_there)` for each that is there and whenever one comes or goes."""
    return _watch(session, robot, "*", lambda agent, _, is_there: handler(agent, is_there))


def watch_elder(session: Session, robot: str, agent: str, since_ns: int, handler: Callable[[], None]) -> Drain:
    """Calls `handler()` when an agent of the same name is seen that was there before `since_ns`.

    Links between agents come one by one, so an elder may be seen a moment after the session is open.
    """

    def compare(_: str, other_ns: int, is_there: bool) -> None:
        if is_there and other_ns < since_ns:
            handler()

    return _watch(session, robot, agent, compare)


def _watch(session: Session, robot: str, agent: str, handler: Callable[[str, int, bool], None]) -> Drain:
    declared = session.zenoh.liveliness().declare_subscriber(
        f"{key(robot, _FOLDER)}/{agent}/*", zenoh.handlers.FifoChannel(_WAITING), history=True
    )

    def take(sample: zenoh.Sample) -> None:
        handler(*_agent(sample), sample.kind == zenoh.SampleKind.PUT)

    return Drain(declared, take, f"presence {robot}")


def _agent(sample: zenoh.Sample) -> tuple[str, int]:
    """Its name, and since when."""
    _, name, since_ns = str(sample.key_expr).rsplit("/", 2)
    return name, int(since_ns)
