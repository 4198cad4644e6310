"""Subscriptions: a channel and a thread that empties it into a handler."""

import atexit
import logging
import threading
from collections.abc import Callable, Iterator
from types import TracebackType
from typing import Protocol, Self, TypeVar

import zenoh
from zenoh import ext

from agents.transport.publish import STREAM_CACHE
from agents.transport.samples import Received, received

logger = logging.getLogger(__name__)

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)
Handler = Callable[[Received], None]

# Messages a stream's handler may be behind before the whole session waits for it; the publishers' caches hold the rest.
_STREAM_QUEUE = 4096
_CLOSE_S = 0.3


class Declared(Protocol[T_co]):
    """Anything that Zenoh declares with a channel."""

    def undeclare(self) -> None:
        """Ends it, and with it the channel."""
        ...

    def __iter__(self) -> Iterator[T_co]: ...


class Drain:
    """A thread that hands everything from a channel to a handler, until the channel ends.

    Attributes:
        failed: how often the handler raised; it is logged and the next message goes on.
    """

    failed: int

    def __init__(self, declared: Declared[T], handler: Callable[[T], None], name: str) -> None:
        self.failed = 0
        self._undeclare = declared.undeclare
        self._closed = self._abandoned = False
        self._thread = threading.Thread(target=self._run, args=(declared, handler), name=name, daemon=True)
        # A thread that waits inside Zenoh when the interpreter ends takes the process down with an abort.
        atexit.register(self.close)
        self._thread.start()

    def close(self) -> None:
        """Ends it. What has come is still handled, if that takes but a moment; a second call does nothing."""
        if self._closed:
            return
        self._closed = True
        self._undeclare()
        if threading.current_thread() is not self._thread:
            self._thread.join(_CLOSE_S)
        self._abandoned = True

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _run(self, channel: Declared[T], handler: Callable[[T], None]) -> None:
        for item in channel:
            try:
                handler(item)
            except Exception:
                if self._abandoned:  # it has outlived its session, and failed for that
                    break
                self.failed += 1
                logger.exception("%s: the handler failed (%d so far)", self._thread.name, self.failed)
            if self._abandoned:
                break
        atexit.unregister(self.close)


class Subscription(Drain):
    """A subscription; `close` it, or close the session.

    Attributes:
        missed: messages that were sent after the first one received and never came; for `subscribe_latest` also those
            which a newer one replaced.
    """

    missed: int

    def __init__(self, declared: Declared[zenoh.Sample], handler: Handler, name: str) -> None:
        self.missed = 0
        self._next: dict[str, int] = {}

        def take(sample: zenoh.Sample) -> None:
            message = received(sample)
            if message.sent is not None:
                sequence = message.sent.sequence
                # A lower number than expected is a publisher that began anew.
                self.missed += max(0, sequence - self._next.get(message.key, sequence))
                self._next[message.key] = sequence + 1
            handler(message)

        super().__init__(declared, take, name)


class Polled:
    """The newest messages of a key, taken when it suits: no thread, and no work while nobody takes.

    Args:
        session: of Zenoh.
        key: with the robot's name.
        depth: so many are kept; older ones make room.
    """

    def __init__(self, session: zenoh.Session, key: str, depth: int) -> None:
        self._declared = session.declare_subscriber(key, zenoh.handlers.RingChannel(depth))

    def take(self) -> list[Received]:
        """What has come since the last time, oldest first."""
        found: list[Received] = []
        while (sample := self._declared.try_recv()) is not None:
            found.append(received(sample))
        return found

    def close(self) -> None:
        """Listen no more."""
        self._declared.undeclare()


def subscribe_latest(session: zenoh.Session, key: str, handler: Handler) -> Subscription:
    """The newest message, whenever the handler is free."""
    return Subscription(session.declare_subscriber(key, zenoh.handlers.RingChannel(1)), handler, f"latest {key}")


def subscribe_stream(session: zenoh.Session, key: str, handler: Handler) -> Subscription:
    """Every message of a `Stream` in order, those first that its cache still holds."""
    history = ext.HistoryConfig(detect_late_publishers=True, max_samples=STREAM_CACHE)
    declared = ext.declare_advanced_subscriber(
        session, key, zenoh.handlers.FifoChannel(_STREAM_QUEUE), history=history, recovery=_recovery()
    )
    return Subscription(declared, handler, f"stream {key}")


def subscribe_state(session: zenoh.Session, key: str, handler: Handler) -> Subscription:
    """The last value of a `State`, now and whenever it changes."""
    history = ext.HistoryConfig(detect_late_publishers=True, max_samples=1)
    declared = ext.declare_advanced_subscriber(
        session, key, zenoh.handlers.RingChannel(1), history=history, recovery=_recovery()
    )
    return Subscription(declared, handler, f"state {key}")


def subscribe_all(session: zenoh.Session, robot: str, handler: Handler) -> Subscription:
    """Every message of every topic of a robot from now on, streams with what the network dropped.

    The handler must be quick: the whole session waits for one that is thousands of messages behind.
    """
    declared = ext.declare_advanced_subscriber(
        session, f"{robot}/**", zenoh.handlers.FifoChannel(_STREAM_QUEUE), recovery=_recovery()
    )
    return Subscription(declared, handler, f"all of {robot}")


def _recovery() -> ext.RecoveryConfig:
    return ext.RecoveryConfig(heartbeat=True, periodic_queries=None)
