"""One recorded message, and the one error a recording raises."""

from typing import NamedTuple


class Message(NamedTuple):
    """One message of a recording, still encoded.

    Attributes:
        topic: as it stands in the file, often with a leading slash.
        type: ROS 2 type name.
        log_ns: when it was recorded [ns]; what the sensor's own stamp says is inside `data`.
        data: CDR.

    >>> Message("/odom", "nav_msgs/msg/Odometry", 5, b"").type
    'nav_msgs/msg/Odometry'
    """

    topic: str
    type: str
    log_ns: int
    data: bytes


class RecordingError(ValueError):
    """A recording that cannot be read or written; the message says which file, what was got and what to do."""
