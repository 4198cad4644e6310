"""Fewer messages than a robot sends, evenly: what is drawn ten times a second is not worked out two hundred times."""

from collections.abc import Iterable, Iterator

from agents import messages
from agents.transport import Received


class Thinning:
    """Lets through one message each so much of the robot's time, and any without a time or set back in it.

    Args:
        type_name: ROS type of messages that tell none.
        every_ns: robot time between two.

    >>> from agents.transport import Received
    >>> def at(t_ms):
    ...     data = messages.encode(messages.compressed_image(t_ms * 1_000_000, np.zeros((1, 1, 3), np.uint8)))
    ...     return Received("camera", "sensor_msgs/msg/CompressedImage", data, None)
    >>> import numpy as np
    >>> some = {at(t_ms): t_ms for t_ms in (0, 50, 100, 120, 199, 200, 40)}
    >>> [some[one] for one in Thinning("", 100_000_000).of(some)]
    [0, 100, 200, 40]
    """

    def __init__(self, type_name: str, every_ns: int) -> None:
        self._type, self._every_ns = type_name, every_ns
        self._last_ns: int | None = None

    def of(self, some: Iterable[Received]) -> Iterator[Received]:
        """Those that are let through, in order."""
        for message in some:
            t_ns = messages.stamp_ns(message.type or self._type, message.data)
            if t_ns is not None and self._last_ns is not None and 0 <= t_ns - self._last_ns < self._every_ns:
                continue
            self._last_ns = t_ns
            yield message
