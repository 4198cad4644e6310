"""The store's sense of time: what is too late to count, and when a clock was set.

Odometry keeps the time. The other sensors do only where they are far ahead of it, as when odometry has stopped: a
camera whose clock runs two seconds ahead must not make every odometry sample late, and no frame may wait for ever.
"""

from enum import Enum

import numpy as np
from numpy.typing import NDArray

#: The other sensors keep the time only where they are ahead of the odometry by this.
LEAD_NS = 10_000_000_000
#: So many odometry samples in a row too late: a clock was set.
_RESET_SAMPLES = 5
_NEVER_NS = int(np.iinfo(np.int64).min // 2)


class Clocks(Enum):
    """What a late odometry sample says of the clocks."""

    RIGHT = "right"
    SET_BACK = "odometry went back on itself"
    APART = "the other sensors are far ahead of the odometry"


class Clock:
    """The newest stamps of odometry and of the other sensors.

    Args:
        max_delay_s: how late, behind the newest, a message may come and still count.

    Attributes:
        watermark_ns: nothing older than this may still arrive.

    >>> clock = Clock(max_delay_s=1.0)
    >>> clock.heard_odometry(10_000_000_000)
    >>> clock.is_late(9_500_000_000), clock.is_late(8_500_000_000)
    (False, True)
    """

    def __init__(self, max_delay_s: float) -> None:
        self._delay_ns = round(max_delay_s * 1e9)
        self._late_in_a_row = 0
        self._odometry_ns = self._others_ns = _NEVER_NS
        self._note()

    def is_late(self, t_ns: int) -> bool:
        """Too old to count?"""
        return t_ns < self.watermark_ns

    def heard_odometry(self, t_ns: int) -> None:
        """An odometry sample that counts."""
        if t_ns > self._odometry_ns:
            self._odometry_ns = t_ns
            self._note()

    def heard_other(self, t_ns: int) -> None:
        """A frame or a reading that counts."""
        if t_ns > self._others_ns:
            self._others_ns = t_ns
            self._note()

    def _note(self) -> None:
        self.watermark_ns = max(self._odometry_ns, self._others_ns - LEAD_NS) - self._delay_ns

    def judge(self, t_ns: int) -> tuple[Clocks, float]:
        """What an odometry sample says of the clocks, and by how many seconds they are off.

        One late sample says nothing; a row of them would go on for ever. Where the other sensors are far ahead, what
        they said of the time is forgotten.
        """
        self._late_in_a_row = self._late_in_a_row + 1 if self.is_late(t_ns) else 0
        if self._late_in_a_row < _RESET_SAMPLES:
            return Clocks.RIGHT, 0.0
        self._late_in_a_row = 0
        if t_ns < self._odometry_ns - self._delay_ns:
            return Clocks.SET_BACK, (self._odometry_ns - t_ns) * 1e-9
        ahead_s = (self._others_ns - t_ns) * 1e-9
        self._others_ns = _NEVER_NS
        self._note()
        return Clocks.APART, ahead_s

    def reset(self) -> None:
        """Another clock may come."""
        self._late_in_a_row = 0
        self._odometry_ns = self._others_ns = _NEVER_NS
        self._note()

    def state(self) -> NDArray[np.int64]:
        """As an array that `restore` takes back."""
        return np.array([self._odometry_ns, self._others_ns, self._late_in_a_row], np.int64)

    def restore(self, state: NDArray[np.int64]) -> None:
        """Go on from there."""
        self._odometry_ns, self._others_ns, self._late_in_a_row = (int(value) for value in state)
        self._note()
