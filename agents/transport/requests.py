"""Requests and replies: bytes to bytes, with an error where there is no answer."""

from collections.abc import Callable

import zenoh

from agents.transport.session import Session
from agents.transport.subscribe import Drain

_WAITING = 64


class RequestError(RuntimeError):
    """A request without a good answer."""


class NoAnswer(RequestError):  # noqa: N818 - says what happened
    """Nobody serves the key, or did not answer in time."""


class Refused(RequestError):  # noqa: N818 - says what happened
    """The server raised; the message is its error's."""


def serve(session: Session, key: str, handler: Callable[[bytes], bytes]) -> Drain:
    """Answers requests one by one in a thread of its own; what the handler raises goes to the caller as `Refused`."""

    def answer(query: zenoh.Query) -> None:
        with query:  # ends the request also if no reply gets through
            try:
                reply = handler(query.payload.to_bytes() if query.payload is not None else b"")
            except Exception as error:
                query.reply_err(f"{type(error).__name__}: {error}")
                return
            query.reply(query.key_expr, reply)

    declared = session.zenoh.declare_queryable(key, zenoh.handlers.FifoChannel(_WAITING), complete=True)
    return Drain(declared, answer, f"serve {key}")


def call(session: Session, key: str, payload: bytes = b"", timeout_s: float = 2.0) -> bytes:
    """The reply of whoever serves `key`; NoAnswer or Refused."""
    for reply in session.zenoh.get(key, payload=payload, timeout=timeout_s):
        if reply.ok is not None:
            return reply.ok.payload.to_bytes()
        text = reply.err.payload.to_string() if reply.err is not None else "Timeout"
        if text == "Timeout":
            raise NoAnswer(f"{key}: no answer within {timeout_s:g} s; the agent that serves it is busy or hangs")
        raise Refused(f"{key}: {text}")
    # No reply at all is also what a server that was killed in the middle of it leaves.
    raise NoAnswer(f"{key}: nobody answers; start the agent that serves it")
