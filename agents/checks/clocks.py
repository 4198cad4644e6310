"""Clocks and rates: does a topic's time run forward, steadily, and with the other topics'?"""

from dataclasses import dataclass

from agents.checks.finding import Finding

_APART_S = 1.0  # log time and stamp
_DISAGREE_S = 0.3  # two topics' stamps at the same moment of recording
_DROPOUT_S = 1.0
_DROPOUT_PERIODS = 10
_SLOW_PICTURES_HZ = 1.0
_REPEATED_SHARE = 0.1


@dataclass
class TopicClock:
    """One topic's stamps, running.

    >>> clock = TopicClock("odom", max_delay_s=1.0)
    >>> for stamp_ns in (0, 10**9, 2 * 10**9, 5 * 10**8):
    ...     clock.add(stamp_ns, stamp_ns)
    >>> [finding.seen for finding in clock.findings()][1:]
    ['the stamps go back 1 time, by 1.500 s at most']
    """

    topic: str
    max_delay_s: float
    max_gap_s: float | None = None
    is_camera: bool = False
    count: int = 0
    zeros: int = 0
    repeated: int = 0
    back: int = 0
    back_s: float = 0.0
    gaps: int = 0
    gap_s: float = 0.0
    gap_at_s: float = 0.0
    forward_s: float = 0.0
    offset_sum_s: float = 0.0
    offset_low_s: float = 0.0
    offset_high_s: float = 0.0
    _last_ns: int | None = None

    def add(self, stamp_ns: int, log_ns: int) -> None:
        """Take a message's stamp and when it was recorded."""
        offset_s = (log_ns - stamp_ns) / 1e9
        self.offset_low_s = offset_s if not self.count else min(self.offset_low_s, offset_s)
        self.offset_high_s = offset_s if not self.count else max(self.offset_high_s, offset_s)
        self.offset_sum_s += offset_s
        self.zeros += stamp_ns == 0
        self.count += 1
        if self._last_ns is not None:
            self._step((stamp_ns - self._last_ns) / 1e9, stamp_ns / 1e9)
        self._last_ns = stamp_ns

    @property
    def offset_s(self) -> float:
        """Mean of log time less stamp."""
        return self.offset_sum_s / self.count if self.count else 0.0

    @property
    def rate_hz(self) -> float:
        """Messages a second of the sensor's time; 0 where that cannot be said."""
        return (self.count - 1 - self.back) / self.forward_s if self.forward_s > 0 else 0.0

    def findings(self) -> list[Finding]:
        """What is wrong with this clock, its rate first."""
        rate = f"{self.count} messages in {self.forward_s:.1f} s: {self.rate_hz:.1f} a second"
        return [Finding("note", self.topic, rate), *self._order(), *self._gaps(), *self._offsets()]

    def _step(self, step_s: float, at_s: float) -> None:
        if step_s < 0:
            self.back += 1
            self.back_s = max(self.back_s, -step_s)
            return
        self.forward_s += step_s
        self.repeated += step_s == 0
        if self.max_gap_s is not None and step_s > self.max_gap_s:
            self.gaps += 1
        if step_s > self.gap_s:
            self.gap_s, self.gap_at_s = step_s, at_s

    def _order(self) -> list[Finding]:
        found: list[Finding] = []
        if self.zeros > 1:
            found.append(
                Finding(
                    "error",
                    self.topic,
                    f"{self.zeros} of {self.count} stamps are zero",
                    "the driver does not fill in the header's stamp",
                    "let the driver stamp each message when its sensor measured it",
                )
            )
        elif self.repeated > _REPEATED_SHARE * self.count:
            found.append(
                Finding(
                    "warning",
                    self.topic,
                    f"{self.repeated} of {self.count} stamps repeat the one before",
                    "the driver sends faster than the sensor measures, or messages were recorded twice",
                    "record each topic once, from one publisher",
                )
            )
        if self.back:
            late = self.back_s <= self.max_delay_s
            found.append(
                Finding(
                    "warning" if late else "error",
                    self.topic,
                    f"the stamps go back {self.back} time{'s' * (self.back > 1)}, by {self.back_s:.3f} s at most",
                    "messages overtook each other on the way"
                    if late
                    else "the clock was set while it ran (NTP, a simulation begun anew), or two runs are in one file",
                    "nothing, they are put in order"
                    if late
                    else "set clocks before driving; record one run in one file",
                )
            )
        return found

    def _gaps(self) -> list[Finding]:
        if self.max_gap_s is not None and self.rate_hz and 1 / self.rate_hz > self.max_gap_s:
            return [
                Finding(
                    "error",
                    self.topic,
                    f"a message every {1 / self.rate_hz:.2f} s, but poses are joined only within {self.max_gap_s:g} s",
                    "a slow or throttled topic",
                    "raise its rate, or odometry.max_gap_s to a little more than the time between two messages",
                )
            ]
        if self.gaps:
            return [
                Finding(
                    "warning",
                    self.topic,
                    f"{self.gaps} gap{'s' * (self.gaps > 1)} longer than {self.max_gap_s:g} s, the longest "
                    f"{self.gap_s:.2f} s before stamp {self.gap_at_s:.3f} s; each ends the trajectory",
                    "a busy radio link or computer",
                    "record on the robot itself, or raise odometry.max_gap_s if it drives steadily in between",
                )
            ]
        found: list[Finding] = []
        if self.rate_hz and self.gap_s > max(_DROPOUT_S, _DROPOUT_PERIODS / self.rate_hz):
            seen = f"silent for {self.gap_s:.2f} s before stamp {self.gap_at_s:.3f} s"
            mend = "look at the cable, the radio link and the load of the computer"
            found.append(Finding("warning", self.topic, seen, "the sensor or its link dropped out", mend))
        if self.is_camera and self.count > 1 and self.rate_hz < _SLOW_PICTURES_HZ:
            seen = f"a picture every {1 / self.rate_hz:.1f} s" if self.rate_hz else "no time between pictures"
            mend = "raise the camera's rate to several pictures a second; learning needs many"
            found.append(Finding("warning", self.topic, seen, "a slow or throttled camera", mend))
        return found

    def _offsets(self) -> list[Finding]:
        if not self.back and self.offset_high_s - self.offset_low_s > _APART_S:
            return [
                Finding(
                    "warning",
                    self.topic,
                    f"recorded between {self.offset_low_s:.2f} and {self.offset_high_s:.2f} s after its stamps",
                    "a clock that drifts or was adjusted, or a link that queues",
                    "keep clocks in step with chrony; send pictures compressed",
                )
            ]
        if self.count and abs(self.offset_s) > _APART_S:
            return [
                Finding(
                    "note",
                    self.topic,
                    f"recorded {abs(self.offset_s):.1f} s {'after' if self.offset_s > 0 else 'before'} its stamps",
                    "the robot's clock and the recorder's are not the same",
                    "nothing, as long as all topics agree: the stamps count",
                )
            ]
        return []


def disagreement(clocks: list[TopicClock]) -> list[Finding]:
    """Topics whose stamps are not of one clock, though they were recorded at the same time."""
    heard = sorted((clock for clock in clocks if clock.count), key=lambda clock: clock.offset_s)
    if len(heard) < 2 or heard[-1].offset_s - heard[0].offset_s <= _DISAGREE_S:
        return []
    early, late = heard[0], heard[-1]
    return [
        Finding(
            "error",
            f"{late.topic} and {early.topic}",
            f"stamps of {late.topic} lie {late.offset_s - early.offset_s:.3f} s behind those of {early.topic} "
            "at the same moment of recording",
            "two computers with clocks of their own, or a driver that stamps late",
            "keep clocks in step with chrony, and stamp when the sensor measures",
        )
    ]
