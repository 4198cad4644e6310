"""One finding, and a running histogram to tell the usual from the rare."""

import math
from typing import Literal, NamedTuple

Severity = Literal["error", "warning", "note"]

_BINS_PER_DECADE = 20
_LEAST = 1e-6
_DECADES = 12


class Finding(NamedTuple):
    """Something seen; as lines with `str`.

    Attributes:
        severity: "error": learning from this is pointless; "warning": it will be worse; "note": good to know.
        topic: where.
        seen: what was seen, with numbers.
        cause: what it likely comes from; empty for a note.
        mend: what to do; empty for a note.

    >>> print(Finding("warning", "odom", "1 pose jump", "it was picked up", "start a new recording then"))
    warning: odom: 1 pose jump
        likely cause: it was picked up
        mend: start a new recording then
    """

    severity: Severity
    topic: str
    seen: str
    cause: str = ""
    mend: str = ""

    def __str__(self) -> str:
        lines = [f"{self.severity}: {self.topic}: {self.seen}"]
        lines += [f"    likely cause: {self.cause}"] if self.cause else []
        lines += [f"    mend: {self.mend}"] if self.mend else []
        return "\n".join(lines)


class Histogram:
    """Counts by size, 12 % a bin from a millionth to a million: quantiles of any number of values in constant memory.

    >>> sizes = Histogram()
    >>> for value in [1.0, 1.0, 1.0, 100.0]:
    ...     sizes.add(value)
    >>> round(sizes.quantile(0.5), 1)
    1.1
    """

    def __init__(self) -> None:
        self.count = 0
        self._bins = [0] * (_BINS_PER_DECADE * _DECADES + 1)

    def add(self, value: float) -> None:
        """Counts a value; one that is not positive counts as the least."""
        position = math.log10(value / _LEAST) * _BINS_PER_DECADE if value > _LEAST else 0.0
        self._bins[min(int(position), len(self._bins) - 1)] += 1
        self.count += 1

    def quantile(self, share: float) -> float:
        """The value below which `share` of them lie; 0 without any."""
        seen = 0
        for index, count in enumerate(self._bins):
            seen += count
            if count and seen >= share * self.count:
                return _LEAST * 10 ** ((index + 0.5) / _BINS_PER_DECADE)
        return 0.0
