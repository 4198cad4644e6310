"""A row of the table: our figure, the peers', the limit, and whether the ratios hold."""

import math
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

#: The short form, on a noisy machine and a small input, asks only for this share of a ratio.
LOOSELY = 0.5


@dataclass(frozen=True)
class Figure:
    """Repeated measurements of one quantity, in one unit.

    >>> Figure([3.0, 1.0, 2.0]).median
    2.0
    """

    values: Sequence[float]

    @property
    def median(self) -> float:
        """The middle one."""
        return statistics.median(self.values)

    @property
    def quartiles(self) -> tuple[float, float]:
        """A quarter lies below the first, a quarter above the second."""
        if len(self.values) < 2:
            return self.median, self.median
        low, _, high = statistics.quantiles(self.values, n=4, method="inclusive")
        return low, high

    def as_json(self) -> dict[str, Any]:
        """For the record."""
        low, high = self.quartiles
        return {"median": self.median, "low": low, "high": high, "n": len(self.values)}


@dataclass(frozen=True)
class Row:
    """One path, measured.

    Attributes:
        path: what was timed.
        ours: our measurements.
        peers: measurements of others doing the same, by name, in the same unit.
        bars: for a peer, how many times less than it we must take; below 1, how many times more we may.
        limit: what no program can go below, by name; None where nobody knows one.
        most: an absolute bound on ours, where the contract states one.
        unit: of all of them: "s" is shown as s, ms or µs.
        note: what else is to be known: sizes, n.
        gaps: for a peer whose bar is known to be missed, what stops it; it is shown, and fails nothing.
    """

    path: str
    ours: Figure
    peers: Mapping[str, Figure] = field(default_factory=dict[str, Figure])
    bars: Mapping[str, float] = field(default_factory=dict[str, float])
    limit: tuple[str, Figure] | None = None
    most: float | None = None
    unit: str = "s"
    note: str = ""
    gaps: Mapping[str, str] = field(default_factory=dict[str, str])

    def ratio(self, peer: str) -> float:
        """How many times as much as ours the peer takes."""
        return self.peers[peer].median / self.ours.median

    def failures(self, share: float = 1.0) -> list[str]:
        """The bars missed, as sentences, but for known gaps; `share` loosens them all."""
        found = [
            f"{self.path}: {peer} takes {self.ratio(peer):.2f} times ours; the bar is {bar:g}"
            for peer, bar in self.bars.items()
            if self.ratio(peer) < bar * share and peer not in self.gaps
        ]
        if self.most is not None and self.ours.median > self.most / share:
            found.append(f"{self.path}: {self.ours.median:.3g} {self.unit}; at most {self.most:g} is asked")
        return found

    def as_json(self) -> dict[str, Any]:
        """For the record."""
        return {
            "path": self.path,
            "unit": self.unit,
            "ours": self.ours.as_json(),
            "peers": {
                name: {**figure.as_json(), "ratio": self.ratio(name), "bar": self.bars.get(name)}
                for name, figure in self.peers.items()
            },
            "limit": None if self.limit is None else {"name": self.limit[0], **self.limit[1].as_json()},
            "most": self.most,
            "holds": not replace(self, gaps={}).failures(),
            "note": self.note,
            "gaps": dict(self.gaps),
        }


@dataclass(frozen=True)
class Growth:
    """How one path's cost grows with one quantity: cost ~ size ** exponent.

    Attributes:
        path: what was timed.
        quantity: what was made ten times as much.
        sizes: of the quantity, ascending.
        figures: the cost at each size.
        most: the largest exponent allowed.
        unit: of the cost.

    >>> Growth("sum", "numbers", [10, 100], [Figure([1.0]), Figure([10.0])], most=1.1).exponent
    1.0
    """

    path: str
    quantity: str
    sizes: Sequence[float]
    figures: Sequence[Figure]
    most: float
    unit: str = "s"

    @property
    def exponent(self) -> float:
        """Between the smallest and the largest size."""
        cost = self.figures[-1].median / self.figures[0].median
        return math.log(cost) / math.log(self.sizes[-1] / self.sizes[0])

    def failures(self, share: float = 1.0) -> list[str]:
        """The bar missed, as a sentence; `share` loosens it."""
        most = self.most + (1 - share)
        if self.exponent <= most:
            return []
        return [
            f"{self.path}: grows with {self.quantity} to the power of {self.exponent:.2f}; at most {most:g} is asked"
        ]

    def as_json(self) -> dict[str, Any]:
        """For the record."""
        return {
            "path": self.path,
            "quantity": self.quantity,
            "sizes": list(self.sizes),
            "figures": [figure.as_json() for figure in self.figures],
            "exponent": self.exponent,
            "most": self.most,
            "unit": self.unit,
            "holds": not self.failures(),
        }
