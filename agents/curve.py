"""The learning curve: how well the weights of each robot minute do on a held-out run."""

from dataclasses import dataclass, field
from typing import Any

from llrp_online.metrics import Score
from llrp_online.scoring import Exam, mean_auc
from llrp_online.trainer import Weights

#: How far the two means look [m]: as far as the paper's camera sees, and the nearer part that changes less.
FAR_M, NEAR_M = 0.25, 0.15


@dataclass(frozen=True, eq=False)
class Point:
    """The score after so many robot minutes."""

    minute: int
    score: Score

    def as_json(self) -> dict[str, Any]:
        """Minute, the two means with the cells they are of, and the whole score."""
        far, far_cells = mean_auc(self.score, FAR_M)
        near, near_cells = mean_auc(self.score, NEAR_M)
        return {
            "minute": self.minute,
            "mean_auc_0_25_cm": None if far_cells == 0 else far,
            "cells_0_25_cm": far_cells,
            "mean_auc_0_15_cm": None if near_cells == 0 else near,
            "cells_0_15_cm": near_cells,
            "score": self.score.as_json(),
        }


@dataclass
class Curve:
    """Scores by robot minute.

    Args:
        exam: the held-out frames; None: the curve stays empty.
        minutes: at which to evaluate.
    """

    exam: Exam | None
    minutes: list[int]
    points: list[Point] = field(default_factory=list[Point])

    def at(self, minute: int, weights: Weights) -> None:
        """Evaluate, if this minute was asked for."""
        if self.exam is not None and minute in self.minutes:
            self.points.append(Point(minute, self.exam.score(weights)))

    def as_json(self) -> list[dict[str, Any]]:
        """All points."""
        return [point.as_json() for point in self.points]

    def lines(self) -> list[str]:
        """All points, for people."""
        return [
            f"after {p['minute']:3d} min: mean AUC {_shown(p['mean_auc_0_25_cm'])} at 0 to 25 cm "
            f"({p['cells_0_25_cm']} cells), {_shown(p['mean_auc_0_15_cm'])} at 0 to 15 cm ({p['cells_0_15_cm']} cells)"
            for p in self.as_json()
        ]


def _shown(value: float | None) -> str:
    return "undefined" if value is None else f"{value:.3f}"
