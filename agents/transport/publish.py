"""Publishers: one for each kind of topic."""

from types import TracebackType
from typing import Self

import zenoh
from zenoh import CongestionControl, Priority, ext

from agents.transport.samples import attachment, encoding

# How many messages a reader may be behind, or a link be cut for, and still get all of them: 100 s of odometry at 20 Hz.
STREAM_CACHE = 2000
# After a pause this long a publisher says once what its last message was, so that a lost last one is noticed.
_STREAM_HEARTBEAT_S = 0.5
_STATE_HEARTBEAT_S = 1.0


class Publisher:
    """Sends to one key; not for two threads at once. Use `Frames`, `Stream` or `State`.

    Attributes:
        sent: how many messages so far.
    """

    sent: int

    def __init__(self, publisher: zenoh.Publisher | ext.AdvancedPublisher) -> None:
        self.sent = 0
        self._publisher = publisher

    def put(self, data: bytes, type_name: str | None = None) -> None:
        """Send; never waits for a reader. `type_name` in place of the type it was declared with."""
        kind = None if type_name is None else encoding(type_name)
        self._publisher.put(data, encoding=kind, attachment=attachment(self.sent))
        self.sent += 1

    def close(self) -> None:
        """Send no more."""
        self._publisher.undeclare()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class Frames(Publisher):
    """For what only the newest counts of: dropped rather than queued, sent at once rather than batched."""

    def __init__(self, session: zenoh.Session, key: str, type_name: str) -> None:
        super().__init__(
            session.declare_publisher(
                key, encoding=encoding(type_name), congestion_control=CongestionControl.DROP, express=True
            )
        )


class Stream(Publisher):
    """For what every message counts of: small and steady. Readers get all that happened within the last `cache`."""

    def __init__(self, session: zenoh.Session, key: str, type_name: str, cache: int = STREAM_CACHE) -> None:
        # Blocking would stall the sender for five seconds and then cut the link; what is dropped is recovered.
        super().__init__(_recoverable(session, key, type_name, cache, _STREAM_HEARTBEAT_S, Priority.DATA_HIGH))


class State(Publisher):
    """For what the last value counts of; whoever subscribes later gets it too."""

    def __init__(self, session: zenoh.Session, key: str, type_name: str) -> None:
        super().__init__(_recoverable(session, key, type_name, 1, _STATE_HEARTBEAT_S, Priority.DATA))


def _recoverable(
    session: zenoh.Session, key: str, type_name: str, cache: int, heartbeat_s: float, priority: Priority
) -> ext.AdvancedPublisher:
    return ext.declare_advanced_publisher(
        session,
        key,
        encoding=encoding(type_name),
        congestion_control=CongestionControl.DROP,
        priority=priority,
        cache=ext.CacheConfig(cache),
        sample_miss_detection=ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=heartbeat_s),
        publisher_detection=True,
    )
