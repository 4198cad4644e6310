"""What travels with a message: its ROS type, its sender's count and clocks."""

import struct
import time
from typing import NamedTuple

import zenoh

_ATTACHMENT = struct.Struct("<QQq")
_CDR = "application/cdr"


class Sent(NamedTuple):
    """When a message was sent, by its sender.

    Attributes:
        sequence: 0, 1, 2, ... since the publisher began.
        monotonic_ns: the machine's clock since it started; the same for all processes of one machine.
        wall_ns: since 1970.
    """

    sequence: int
    monotonic_ns: int
    wall_ns: int


class Received(NamedTuple):
    """A message as it came.

    Attributes:
        key: with the robot's name.
        type: ROS type, empty if it is no ROS message or comes from a sender that does not say.
        data: CDR, or what else was sent.
        sent: None if it comes from a sender that does not say.
    """

    key: str
    type: str
    data: bytes
    sent: Sent | None

    def age_s(self) -> float:
        """How long ago it was sent, on this machine; 0 if its sender does not say."""
        return (time.monotonic_ns() - self.sent.monotonic_ns) / 1e9 if self.sent else 0.0


def encoding(type_name: str) -> zenoh.Encoding:
    """The Zenoh encoding of a ROS type; plain bytes without one."""
    return zenoh.Encoding(f"{_CDR};{type_name}") if type_name else zenoh.Encoding.ZENOH_BYTES


def attachment(sequence: int) -> bytes:
    """Count and clocks, now."""
    return _ATTACHMENT.pack(sequence, time.monotonic_ns(), time.time_ns())


def received(sample: zenoh.Sample) -> Received:
    """A Zenoh sample as one plain value."""
    kind, _, type_name = str(sample.encoding).partition(";")
    extra = sample.attachment.to_bytes() if sample.attachment is not None else b""
    # ROS 2's own middleware and others attach something else.
    sent = Sent(*_ATTACHMENT.unpack(extra)) if len(extra) == _ATTACHMENT.size else None
    return Received(str(sample.key_expr), type_name if kind == _CDR else "", sample.payload.to_bytes(), sent)
