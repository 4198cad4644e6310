"""Subscriptions: a channel and a thread that empties it into a handler."""

import atexit
import logging
import math
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any, Protocol, TypeVar

import zenoh
from zenoh import ext

from agents.transport.naming import read_attachment
from agents.transport.publish import STREAM_CACHE
from agents.transport.ros_graph import Qos
from agents.transport.samples import Received, received
from agents.transport.session import Session
from replay.closing import Closing

logger = logging.getLogger(__name__)

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)
Handler = Callable[[Received], None]

# Messages a stream's handler may be behind before the whole session waits for it; the publishers' caches hold the rest.
_STREAM_QUEUE = 4096
_CLOSE_S = 0.3
# Messages that may wait where there is patience: at 20 a second, eight tenths of a second of them.
_PATIENT_QUEUE = 16
# Younger than this a message is not late; and a stall is over, or was none but a slow handler, after so long.
_LATE_S, _STALL_S = 0.1, 1.0


class Declared(Protocol[T_co]):
    """Anything that Zenoh declares with a channel."""

    def undeclare(self) -> None:
        """Ends it, and with it the channel."""
        ...

    def __iter__(self) -> Iterator[T_co]: ...


class Ring(Declared[zenoh.Sample], Protocol):
    """One that can be asked without waiting."""

    def try_recv(self) -> zenoh.Sample | None:
        """The next, or None."""
        ...


class Drain(Closing):
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


class _Patient:
    """A ring that is emptied in order after a stall, and of which the newest is taken where the handler is too slow.

    A stall is over soon: what is late for longer is a handler that does not keep up. What does not say its age counts
    as late.
    """

    def __init__(self, declared: Ring, patience_s: float) -> None:
        self._declared, self._patience_s = declared, patience_s
        self.undeclare = declared.undeclare

    def __iter__(self) -> Iterator[zenoh.Sample]:
        fresh_s = time.monotonic()  # when it last was not late
        for sample in self._declared:
            taken, late_s, now_s = sample, _age_s(sample), time.monotonic()
            if late_s > self._patience_s or now_s - fresh_s > _STALL_S:
                while (newer := self._declared.try_recv()) is not None:
                    taken = newer
            if _age_s(taken) < _LATE_S:
                fresh_s = now_s
            yield taken


def _age_s(sample: zenoh.Sample) -> float:
    sent = read_attachment(sample.attachment.to_bytes()) if sample.attachment is not None else None
    return math.inf if sent is None else sent.age_s()


class Subscription(Drain):
    """A subscription; `close` it, or close the session.

    Attributes:
        missed: messages that were sent after the first one received and never came; for `subscribe_latest` also those
            which a newer one replaced.
    """

    missed: int

    def __init__(
        self, session: Session, key: str, qos: Qos | None, declared: Declared[zenoh.Sample], handler: Handler, name: str
    ) -> None:
        self.missed = 0
        self._next: dict[tuple[str, bytes], int] = {}
        naming = session.naming
        self._token = None if qos is None else session.subscribes(key, naming.type_of(key), qos)

        def take(sample: zenoh.Sample) -> None:
            message = received(sample, naming)
            if message.sent is not None:
                sequence, sender = message.sent.sequence, (message.key, message.sent.publisher)
                # A lower number than expected is a publisher that began anew.
                self.missed += max(0, sequence - self._next.get(sender, sequence))
                self._next[sender] = sequence + 1
            handler(message)

        super().__init__(declared, take, name)

    def close(self) -> None:
        """Ends it, as any."""
        token, self._token = self._token, None
        if token is not None:
            token.undeclare()
        super().close()


class Polled:
    """The newest messages of a key, taken when it suits: no thread, and no work while nobody takes.

    Args:
        session: of the agent.
        key: with the robot's name.
        depth: so many are kept; older ones make room.
    """

    def __init__(self, session: Session, key: str, depth: int) -> None:
        self._session = session
        name, ring = session.naming.subscribed(key), zenoh.handlers.RingChannel(depth)
        self._declared = session.zenoh.declare_subscriber(name, ring)

    def take(self) -> list[Received]:
        """What has come since the last time, oldest first."""
        found: list[Received] = []
        while (sample := self._declared.try_recv()) is not None:
            found.append(received(sample, self._session.naming))
        return found

    def close(self) -> None:
        """Listen no more."""
        self._declared.undeclare()


def subscribe_latest(session: Session, key: str, handler: Handler, patience_s: float = 0.0) -> Subscription:
    """The newest message, whenever the handler is free.

    With patience, those before it, too, in order, as long as they are no older than this when their turn comes: a
    moment without the processor loses none. A handler that is too slow for all still gets the newest.
    """
    depth = _PATIENT_QUEUE if patience_s else 1
    declared = session.zenoh.declare_subscriber(session.naming.subscribed(key), zenoh.handlers.RingChannel(depth))
    ring: Any = declared  # its types know nothing of the channel
    channel: Declared[zenoh.Sample] = _Patient(ring, patience_s) if patience_s else ring
    return Subscription(session, key, Qos.LATEST, channel, handler, f"latest {key}")


def subscribe_stream(session: Session, key: str, handler: Handler) -> Subscription:
    """Every message of a `Stream` in order, those first that its cache still holds."""
    declared = _recovering(
        session, session.naming.subscribed(key), zenoh.handlers.FifoChannel(_STREAM_QUEUE), STREAM_CACHE
    )
    return Subscription(session, key, Qos.STREAM, declared, handler, f"stream {key}")


def subscribe_state(session: Session, key: str, handler: Handler) -> Subscription:
    """The last value of a `State`, now and whenever it changes."""
    declared = _recovering(session, session.naming.subscribed(key), zenoh.handlers.RingChannel(1), 1)
    return Subscription(session, key, Qos.STATE, declared, handler, f"state {key}")


def subscribe_all(session: Session, robot: str, handler: Handler) -> Subscription:
    """Every message of every topic of a robot from now on, streams with what the network dropped.

    The handler must be quick: the whole session waits for one that is thousands of messages behind.
    """
    everything = session.naming.everything(robot)
    declared = _recovering(session, everything, zenoh.handlers.FifoChannel(_STREAM_QUEUE), 0)
    return Subscription(session, everything, None, declared, handler, f"all of {robot}")


def _recovering(
    session: Session,
    wire: str,
    channel: "zenoh.handlers.FifoChannel[zenoh.Sample] | zenoh.handlers.RingChannel[zenoh.Sample]",
    history: int,
) -> ext.AdvancedSubscriber[Any]:
    """Asks again for what the network dropped, and first for the last `history` messages."""
    return ext.declare_advanced_subscriber(
        session.zenoh,
        wire,
        channel,
        history=ext.HistoryConfig(detect_late_publishers=True, max_samples=history) if history else None,
        recovery=ext.RecoveryConfig(heartbeat=True, periodic_queries=None),
    )
