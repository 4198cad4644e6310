"""The budget of training steps, by the sensors' clock: so many for each second the robot lives.

Counted in sensor time, a recording played fast, slow or in virtual time is learned from equally. A learner that cannot
keep up does not run after lost time for ever: what lies more than a few seconds back is let go, and counted.
"""

from typing import Any

#: Longest stretch of sensor time between two messages that counts: a longer one is a pause, not life.
_LONGEST_STEP_S = 1.0
#: Steps owed for longer than this are let go.
_BACKLOG_S = 5.0
#: Sensor time going back further than this is another clock, not a late message.
_OTHER_CLOCK_S = 5.0


class Pace:
    """Steps allowed and steps taken.

    Args:
        steps_per_second: of sensor time.

    >>> pace = Pace(steps_per_second=5.0)
    >>> for t_s in (0.0, 0.5, 1.0):
    ...     pace.advance(round(t_s * 1e9), learning=True)
    >>> taken = 0
    >>> while pace.due():
    ...     pace.taken(); taken += 1
    >>> taken, pace.lived_s
    (5, 1.0)
    """

    def __init__(self, steps_per_second: float) -> None:
        self._rate = steps_per_second
        self._last_ns: int | None = None
        self._owed = 0.0
        self.lived_s = 0.0
        self.let_go = 0.0

    def advance(self, t_ns: int, *, learning: bool) -> None:
        """The sensors' clock shows `t_ns`; steps fall due only while `learning`."""
        last = self._last_ns
        if last is None or t_ns < last - _OTHER_CLOCK_S * 1e9:
            self._last_ns = t_ns
            return
        if t_ns <= last:
            return
        self._last_ns = t_ns
        passed_s = min((t_ns - last) * 1e-9, _LONGEST_STEP_S)
        self.lived_s += passed_s
        if learning:
            self._owed += passed_s * self._rate
            most = max(_BACKLOG_S * self._rate, 1.0)
            self.let_go += max(self._owed - most, 0.0)
            self._owed = min(self._owed, most)

    def end_recording(self) -> None:
        """The next time may be of another clock."""
        self._last_ns = None

    def due(self) -> bool:
        """Is a step owed? The hair below one forgives the rounding of many small stretches."""
        return self._owed >= 1.0 - 1e-6

    def taken(self) -> None:
        """A step was taken, or there was nothing to take it on."""
        self._owed -= 1.0

    def state(self) -> dict[str, float | int | None]:
        """JSON values for `restore`."""
        return {"owed": self._owed, "lived_s": self.lived_s, "let_go": self.let_go, "last_ns": self._last_ns}

    def restore(self, state: dict[str, Any]) -> None:
        """Go on exactly from there; another clock may come next."""
        self._owed, self.lived_s, self.let_go = state["owed"], state["lived_s"], state["let_go"]
        self._last_ns = state["last_ns"]
