"""Short-range sensors: does each say something, in the unit of its threshold?"""

import math

from agents.checks.finding import Finding, Severity
from llrp_online.configuration.rig import ShortRange

_FEW_SHARE = 0.01
_MANY_NAN_SHARE = 0.5
_ZERO_SHARE = 0.2
_UNITS_FACTOR = 50.0


class Range:
    """One sensor's values, running.

    >>> values = Range(ShortRange(name="left", topic="range", field="ranges[0]", below=0.1))
    >>> for _ in range(3):
    ...     values.add(math.inf, 0)
    >>> values.findings()[1].seen
    'left is always infinite (3 readings)'
    """

    def __init__(self, sensor: ShortRange) -> None:
        self._sensor = sensor
        self._count = self._nan = self._infinite = self._zero = self._positive = self._known = 0
        self._low, self._high = math.inf, -math.inf

    def add(self, value: float, bit: int) -> None:
        """Take a value as the sensor gave it, and the bit it was read as: 1, 0, -1 unknown."""
        self._count += 1
        self._nan += math.isnan(value)
        self._infinite += value == math.inf
        self._zero += value == 0
        self._known += bit >= 0
        self._positive += bit == 1
        if math.isfinite(value):
            self._low, self._high = min(self._low, value), max(self._high, value)

    def findings(self) -> list[Finding]:
        """What is wrong with this sensor, its share of positives first."""
        if not self._count:
            return []
        share = 100 * self._positive / max(1, self._known)
        reach = f"{self._low:.3g} to {self._high:.3g}" if self._low <= self._high else "no finite value"
        counts = f"{self._sensor.name}: {share:.1f} % positive of {self._known} known readings, values {reach}"
        return [Finding("note", self._sensor.topic, counts), *self._silent(), *self._one_sided()]

    def _silent(self) -> list[Finding]:
        seen = ("always NaN", self._nan), ("always infinite", self._infinite), ("always zero", self._zero)
        for what, count in seen:
            if count == self._count:
                mend = "hold a hand before it and look at the topic"
                met_nothing = what == "always infinite" or (what == "always zero" and self._sensor.below is None)
                severity = "warning" if met_nothing else "error"
                cause = "not connected, blind, or `field` names another sensor"
                cause += "; or it was never near anything" if met_nothing else ""
                return [self._finding(severity, f"is {what} ({count} readings)", cause, mend)]
        found: list[Finding] = []
        if self._nan > _MANY_NAN_SHARE * self._count:
            cause = "a sensor out of its range that says NaN rather than inf"
            mend = "let the driver send inf where nothing is in reach; NaN is unknown and teaches nothing"
            found.append(self._finding("warning", f"is NaN in {self._nan} of {self._count} readings", cause, mend))
        if self._zero > _ZERO_SHARE * self._count and self._sensor.below is not None:
            cause = "a driver that sends 0 where it saw nothing"
            mend = "let the driver send inf where nothing is in reach; 0 is read as touching"
            found.append(self._finding("warning", f"is 0 in {self._zero} of {self._count} readings", cause, mend))
        return found

    def _one_sided(self) -> list[Finding]:
        if not self._known or not math.isfinite(self._low) or self._low == self._high == 0:
            return []
        limit = self._sensor.below if self._sensor.below is not None else self._sensor.above
        threshold = f"the threshold {limit:g}, values {self._low:.3g} to {self._high:.3g}"
        if 0 < self._positive < self._known:
            if self._positive >= _FEW_SHARE * self._known:
                return []
            mend = "drive closer to obstacles more often, or move the threshold"
            return [
                self._finding(
                    "warning",
                    f"is positive in {self._positive} of {self._known} readings only",
                    "few obstacles met",
                    mend,
                )
            ]
        seen = f"is {'always' if self._positive else 'never'} positive at {threshold}"
        if limit is not None and limit > 0 and self._low > 0:
            if self._low > limit and self._high > _UNITS_FACTOR * limit:
                cause = "values in millimetres or centimetres, the threshold in metres"
                return [self._finding("error", seen, cause, "use one unit for both")]
            if self._high * _UNITS_FACTOR < limit:
                cause = "values in metres, the threshold in millimetres or centimetres"
                return [self._finding("error", seen, cause, "use one unit for both")]
        cause = "it met only one side of the threshold, or the threshold is outside what it measures"
        mend = "drive both near to obstacles and away from them, or set the threshold between near and far values"
        return [self._finding("warning", seen, cause, mend)]

    def _finding(self, severity: Severity, seen: str, cause: str, mend: str) -> Finding:
        return Finding(severity, self._sensor.topic, f"{self._sensor.name} {seen}", cause, mend)
