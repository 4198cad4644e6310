"""Publishers: one for each kind of topic."""

import os
from collections.abc import Callable
from typing import NamedTuple

import zenoh
from zenoh import CongestionControl, Priority, ext

from agents.transport.naming import PUBLISHER_BYTES
from agents.transport.ros_graph import Qos
from agents.transport.samples import encoding
from agents.transport.session import Session
from replay.closing import Closing

# How many messages a reader may be behind, or a link be cut for, and still get all of them: 100 s of odometry at 20 Hz.
STREAM_CACHE = 2000
# After a pause this long a publisher says once what its last message was, so that a lost last one is noticed.
_STREAM_HEARTBEAT_S = 0.5
_STATE_HEARTBEAT_S = 1.0


_Declared = zenoh.Publisher | ext.AdvancedPublisher


class _Way(NamedTuple):
    """One key of a topic: where its type is part of the key, each type has a way of its own."""

    wire: str
    publisher: _Declared
    token: zenoh.LivelinessToken | None


class Publisher(Closing):
    """Sends to one topic; not for two threads at once. Use `Frames`, `Stream` or `State`.

    Attributes:
        sent: how many messages so far.
    """

    sent: int

    def __init__(
        self, session: Session, key: str, type_name: str, qos: Qos, declare: Callable[[str, zenoh.Encoding], _Declared]
    ) -> None:
        self.sent = 0
        self._session, self._key, self._qos, self._declare = session, key, qos, declare
        self._type = type_name or session.naming.type_of(key)
        self._identity = os.urandom(PUBLISHER_BYTES)
        self._ways: dict[str, _Way] = {}
        self._way(self._type)

    def put(self, data: bytes, type_name: str | None = None) -> None:
        """Send; never waits for a reader. `type_name` in place of the type it was declared with."""
        kind = self._type if type_name is None else type_name
        way = self._ways.get(kind) or self._way(kind)
        attachment = self._session.naming.attachment(self.sent, self._identity)
        way.publisher.put(data, encoding=encoding(kind), attachment=attachment)
        self.sent += 1

    def close(self) -> None:
        """Send no more."""
        for way in {way.wire: way for way in self._ways.values()}.values():
            way.publisher.undeclare()
            if way.token is not None:
                way.token.undeclare()

    def _way(self, type_name: str) -> _Way:
        """Declared when a type is first sent; types that share a key share the way."""
        wire = self._session.naming.published(self._key, type_name)
        found = next((way for way in self._ways.values() if way.wire == wire), None)
        if found is None:
            token = self._session.publishes(self._key, type_name, self._qos)
            found = _Way(wire, self._declare(wire, encoding(type_name)), token)
        self._ways[type_name] = found
        return found


class Frames(Publisher):
    """For what only the newest counts of: dropped rather than queued, sent at once rather than batched."""

    def __init__(self, session: Session, key: str, type_name: str) -> None:
        def declare(wire: str, kind: zenoh.Encoding) -> zenoh.Publisher:
            return session.zenoh.declare_publisher(
                wire, encoding=kind, congestion_control=CongestionControl.DROP, express=True
            )

        super().__init__(session, key, type_name, Qos.LATEST, declare)


class Stream(Publisher):
    """For what every message counts of: small and steady. Readers get all that happened within the last `cache`."""

    def __init__(self, session: Session, key: str, type_name: str, cache: int = STREAM_CACHE) -> None:
        # Blocking would stall the sender for five seconds and then cut the link; what is dropped is recovered.
        declare = _recoverable(session, cache, _STREAM_HEARTBEAT_S, Priority.DATA_HIGH)
        super().__init__(session, key, type_name, Qos.STREAM, declare)


class State(Publisher):
    """For what the last value counts of; whoever subscribes later gets it too."""

    def __init__(self, session: Session, key: str, type_name: str) -> None:
        super().__init__(
            session, key, type_name, Qos.STATE, _recoverable(session, 1, _STATE_HEARTBEAT_S, Priority.DATA)
        )


def _recoverable(
    session: Session, cache: int, heartbeat_s: float, priority: Priority
) -> Callable[[str, zenoh.Encoding], ext.AdvancedPublisher]:
    def declare(wire: str, kind: zenoh.Encoding) -> ext.AdvancedPublisher:
        return ext.declare_advanced_publisher(
            session.zenoh,
            wire,
            encoding=kind,
            congestion_control=CongestionControl.DROP,
            priority=priority,
            cache=ext.CacheConfig(cache),
            sample_miss_detection=ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=heartbeat_s),
            publisher_detection=True,
        )

    return declare
