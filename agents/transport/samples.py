"""What travels with a message: its ROS type, its sender's count and clocks."""

import time
from typing import NamedTuple

import zenoh

from agents.transport.naming import Naming, Sent, read_attachment

_CDR = "application/cdr"


class Received(NamedTuple):
    """A message as it came.

    Attributes:
        key: `<robot>/<topic>`, whatever it is called on the wire.
        type: ROS type, empty if it is no ROS message, or comes from a sender that does not say and nobody expects it.
        data: CDR, or what else was sent.
        sent: None if it comes from a sender that does not say.
    """

    key: str
    type: str
    data: bytes
    sent: Sent | None

    def wall_ns(self) -> int:
        """When it was sent, since 1970; now, if its sender does not say."""
        return time.time_ns() if self.sent is None else self.sent.wall_ns

    def age_s(self) -> float:
        """How long ago it was sent: on this machine, or as far as clocks agree; 0 if its sender does not say."""
        return 0.0 if self.sent is None else self.sent.age_s()


def encoding(type_name: str) -> zenoh.Encoding:
    """The Zenoh encoding of a ROS type; plain bytes without one."""
    return zenoh.Encoding(f"{_CDR};{type_name}") if type_name else zenoh.Encoding.ZENOH_BYTES


def received(sample: zenoh.Sample, naming: Naming) -> Received:
    """A Zenoh sample as one plain value."""
    key, type_name = naming.read(str(sample.key_expr))
    kind, _, told = str(sample.encoding).partition(";")
    extra = sample.attachment.to_bytes() if sample.attachment is not None else b""
    told = told if kind == _CDR else ""
    return Received(key, told or type_name, sample.payload.to_bytes(), read_attachment(extra))
