"""What a topic is called on the wire: one idea, three dialects. Agents know a topic as `<robot>/<topic>`, always.

- `Plain`: that is its key.
- `Ros2Dds`: the key is the ROS 2 topic's name, as zenoh-bridge-ros2dds has it; nothing goes with the message.
- `Ros2Zenoh`: `<domain>/<topic>/<type>/<type hash>`, as ROS 2's own Zenoh middleware, rmw_zenoh, has it.

Only what is a ROS message has another name: a topic whose type is known, from the table of topics or from whoever
publishes it. Weights, requests and presence are between agents, and their keys are plain in every dialect.

Sources: https://github.com/ros2/rmw_zenoh/blob/rolling/docs/design.md and
https://github.com/eclipse-zenoh/zenoh-plugin-ros2dds.
"""

import struct
import time
from collections.abc import Callable, Mapping
from typing import NamedTuple, Protocol

_PLAIN_ATTACHMENT = struct.Struct("<QQq")
PUBLISHER_BYTES = 16
_RMW_ATTACHMENT = struct.Struct(f"<qqB{PUBLISHER_BYTES}s")
_DDS_PACKAGE = "dds_"


class Sent(NamedTuple):
    """When a message was sent, by its sender.

    Attributes:
        sequence: one more with each message of a publisher.
        monotonic_ns: the machine's clock since it started, the same for all processes of one machine; None from a
            sender that does not say.
        wall_ns: since 1970.
        publisher: tells the publishers of one topic apart; empty where a topic has but one.
    """

    sequence: int
    monotonic_ns: int | None
    wall_ns: int
    publisher: bytes = b""

    def age_s(self) -> float:
        """How long ago it was: on this machine, or as far as the clocks of two agree."""
        if self.monotonic_ns is None:
            return max(0, time.time_ns() - self.wall_ns) / 1e9
        return (time.monotonic_ns() - self.monotonic_ns) / 1e9


class Naming(Protocol):
    """A dialect. `key` is `<robot>/<topic>`, `wire` is what Zenoh sees."""

    def published(self, key: str, type_name: str, /) -> str:
        """Where messages of a type are put; `type_name` may be empty."""
        ...

    def subscribed(self, key: str, /) -> str:
        """What is subscribed to."""
        ...

    def everything(self, robot: str, /) -> str:
        """What all topics of a robot match."""
        ...

    def read(self, wire: str, /) -> tuple[str, str]:
        """Key and ROS type, empty if unknown, of a message that came."""
        ...

    def type_of(self, key: str, /) -> str:
        """The ROS type that a topic is expected to have; empty if it is none of ROS."""
        ...

    def attachment(self, sequence: int, publisher: bytes, /) -> bytes | None:
        """What goes with a message: its count and clocks, and `publisher`, 16 bytes that no other publisher has."""
        ...


class Plain:
    """`<robot>/<topic>` as it is.

    Args:
        types: ROS types by key, for senders that do not say.

    >>> Plain().published("rover/odom", "nav_msgs/msg/Odometry")
    'rover/odom'
    """

    def __init__(self, types: Mapping[str, str] | None = None) -> None:
        self._types = dict(types or {})

    def published(self, key: str, _type_name: str, /) -> str:
        """The key."""
        return key

    def subscribed(self, key: str) -> str:
        """The key."""
        return key

    def everything(self, robot: str) -> str:
        """All below the robot's name."""
        return f"{robot}/**"

    def read(self, wire: str) -> tuple[str, str]:
        """Itself, and the type that the table has."""
        return wire, self.type_of(wire)

    def type_of(self, key: str) -> str:
        """As the table has it."""
        return self._types.get(key, "")

    def attachment(self, sequence: int, _publisher: bytes, /) -> bytes | None:
        """Count and both clocks."""
        return _PLAIN_ATTACHMENT.pack(sequence, time.monotonic_ns(), time.time_ns())


class RosNames:
    """What ROS 2 calls a robot's topics.

    Args:
        robot: its name, before each key.
        namespace: of the robot's topics in ROS 2, without slashes at its ends; may be empty.
        renamed: topics that have another name there.

    >>> names = RosNames("rover", "bot1", {"cmd_vel": "commands/velocity"})
    >>> names.name("rover/odom"), names.name("rover/cmd_vel"), names.key("bot1/commands/velocity")
    ('bot1/odom', 'bot1/commands/velocity', 'rover/cmd_vel')
    """

    def __init__(self, robot: str, namespace: str = "", renamed: Mapping[str, str] | None = None) -> None:
        self._robot = f"{robot}/"
        self.before = f"{namespace}/" if namespace else ""
        self._there = dict(renamed or {})
        self._here = {there: here for here, there in self._there.items()}

    def name(self, key: str) -> str:
        """In ROS 2, without the slash at its beginning."""
        topic = key.removeprefix(self._robot)
        return self.before + self._there.get(topic, topic)

    def key(self, name: str) -> str:
        """The other way."""
        topic = name.removeprefix(self.before)
        return self._robot + self._here.get(topic, topic)

    def is_key(self, text: str) -> bool:
        """Whether it begins as a key does."""
        return text.startswith(self._robot)


class Ros2Dds:
    """The ROS 2 topic's name.

    Args:
        names: what topics are called.
        types: ROS types by key.

    >>> naming = Ros2Dds(RosNames("rover", "bot1"), {"rover/odom": "nav_msgs/msg/Odometry"})
    >>> naming.subscribed("rover/odom"), naming.subscribed("rover/learner/weights")
    ('bot1/odom', 'rover/learner/weights')
    >>> naming.read("bot1/odom")
    ('rover/odom', 'nav_msgs/msg/Odometry')
    """

    def __init__(self, names: RosNames, types: Mapping[str, str]) -> None:
        self._names, self._types = names, dict(types)

    def published(self, key: str, type_name: str) -> str:
        """The topic's name."""
        return self._names.name(key) if type_name or self.type_of(key) else key

    def subscribed(self, key: str) -> str:
        """The topic's name."""
        return self.published(key, "")

    def everything(self, _robot: str, /) -> str:
        """All in the namespace."""
        return f"{self._names.before}**"

    def read(self, wire: str) -> tuple[str, str]:
        """A key that is plain stays so."""
        key = self._names.key(wire)
        if not self.type_of(key) and self._names.is_key(wire):
            key = wire
        return key, self.type_of(key)

    def type_of(self, key: str) -> str:
        """As the table has it."""
        return self._types.get(key, "")

    def attachment(self, _sequence: int, _publisher: bytes, /) -> bytes | None:
        """The bridge sends none, and expects none."""
        return None


class Ros2Zenoh:
    """`<domain>/<topic>/<type>/<type hash>`.

    Hashes differ between the releases of ROS 2, so that any hash is subscribed to, and the type read from the key.

    Args:
        names: what topics are called.
        types: ROS types by key.
        type_hash: gives a type's hash, such as "RIHS01_0a1b...".
        domain: ROS_DOMAIN_ID.

    >>> types = {"rover/odom": "nav_msgs/msg/Odometry"}
    >>> naming = Ros2Zenoh(RosNames("rover"), types, lambda type_name: "RIHS01_0a1b", domain=7)
    >>> naming.published("rover/odom", "")
    '7/odom/nav_msgs::msg::dds_::Odometry_/RIHS01_0a1b'
    >>> naming.subscribed("rover/odom"), naming.subscribed("rover/learner/weights")
    ('7/odom/*/*', 'rover/learner/weights')
    >>> naming.read("7/a/b/std_msgs::msg::dds_::Bool_/TypeHashNotSupported")
    ('rover/a/b', 'std_msgs/msg/Bool')
    """

    def __init__(
        self, names: RosNames, types: Mapping[str, str], type_hash: Callable[[str], str], domain: int = 0
    ) -> None:
        self.names, self._types, self._hash, self.domain = names, dict(types), type_hash, domain

    def published(self, key: str, type_name: str) -> str:
        """With the hash that ROS 2 Jazzy and later give the type."""
        name = type_name or self.type_of(key)
        return f"{self.domain}/{self.names.name(key)}/{self.typed(name)}" if name else key

    def subscribed(self, key: str) -> str:
        """Any type, any hash."""
        return f"{self.domain}/{self.names.name(key)}/*/*" if self.type_of(key) else key

    def everything(self, _robot: str, /) -> str:
        """All in the domain and the namespace."""
        return f"{self.domain}/{self.names.before}**"

    def read(self, wire: str) -> tuple[str, str]:
        """The type is in the key; what is not of this shape is plain."""
        domain, _, rest = wire.partition("/")
        topic, _, last = rest.rpartition("/")
        topic, _, dds = topic.rpartition("/")
        parts = dds.split("::")
        if domain != str(self.domain) or not topic or len(parts) != 4 or parts[2] != _DDS_PACKAGE or not last:
            return wire, ""
        return self.names.key(topic), f"{parts[0]}/{parts[1]}/{parts[3].removesuffix('_')}"

    def type_of(self, key: str) -> str:
        """As the table has it."""
        return self._types.get(key, "")

    def attachment(self, sequence: int, publisher: bytes) -> bytes | None:
        """Count, the wall's clock, and who sends; counts begin with 1."""
        return _RMW_ATTACHMENT.pack(sequence + 1, time.time_ns(), PUBLISHER_BYTES, publisher)

    def typed(self, type_name: str) -> str:
        """Type and hash, as they stand in a key."""
        package, kind, name = type_name.split("/")
        return f"{package}::{kind}::{_DDS_PACKAGE}::{name}_/{self._hash(type_name)}"


def read_attachment(extra: bytes) -> Sent | None:
    """What a sender of any dialect said of its message; None if nothing that is known.

    >>> read_attachment(Plain().attachment(3, b"")).sequence, read_attachment(b"other")
    (3, None)
    """
    if len(extra) == _PLAIN_ATTACHMENT.size:
        return Sent(*_PLAIN_ATTACHMENT.unpack(extra))
    if len(extra) == _RMW_ATTACHMENT.size and extra[16] == PUBLISHER_BYTES:
        sequence, wall_ns, _, publisher = _RMW_ATTACHMENT.unpack(extra)
        return Sent(sequence, None, wall_ns, publisher)
    return None
