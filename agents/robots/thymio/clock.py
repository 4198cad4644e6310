"""When the robot measured: its own beats, put on this computer's clock.

A message cannot come before it was sent; it may come late, by a moment on a cable, by more on a busy computer or over
the dongle. Beats come evenly. So the beats say how far apart two reports are, and the earliest arrivals say when.
"""

import time

from agents.robots.thymio.firmware import BEAT_S

_BEAT_NS = round(BEAT_S * 1e9)
_WRAP = 1 << 16
#: What a late report moves the clock by, of its lateness: a robot's clock that is 1 % slow stays 10 ms behind.
_GIVE = 0.05
_FORGET_NS = 500_000_000  # a clock so far behind has missed something; it begins anew


class HostClock:
    """This computer's time since 1970, but never set back or forth while it runs: its start, and what passed since."""

    def __init__(self) -> None:
        self._offset_ns = time.time_ns() - time.monotonic_ns()

    def now_ns(self) -> int:
        """Now [ns]."""
        return self._offset_ns + time.monotonic_ns()


class BeatClock:
    """Stamps reports; they only grow, and none is later than its report's arrival.

    >>> clock = BeatClock()
    >>> clock.stamp_ns(0, 1_000_000_000), clock.stamp_ns(5, 1_051_000_000), clock.stamp_ns(10, 1_180_000_000)
    (1000000000, 1050050000, 1104047500)
    """

    def __init__(self) -> None:
        self._beats: int | None = None
        self._stamp_ns = 0

    def stamp_ns(self, beats: int, arrival_ns: int) -> int:
        """When the report of that beat was made [ns]."""
        due_ns = arrival_ns if self._beats is None else self._stamp_ns + (beats - self._beats) % _WRAP * _BEAT_NS
        late_ns = arrival_ns - due_ns
        if late_ns > _FORGET_NS:
            due_ns = arrival_ns
        else:
            due_ns += late_ns if late_ns < 0 else round(_GIVE * late_ns)
        self._stamp_ns = max(due_ns, self._stamp_ns + 1)
        self._beats = beats
        return self._stamp_ns


def age_ns(report_beats: int, beats: int) -> int:
    """How long before a report something was measured, by its beats.

    >>> age_ns(3, 65534)
    50000000
    """
    return (report_beats - beats) % _WRAP * _BEAT_NS
