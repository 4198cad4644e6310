"""The learning curve: how well the weights of each robot minute do on a held-out run."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from llrp_online.architecture import Weights
from llrp_online.metrics import Score
from llrp_online.scoring import Exam, mean_auc

#: How far the two means look [m]: as far as the paper's camera sees, and the nearer part that changes less.
FAR_M, NEAR_M = 0.25, 0.15


@dataclass(frozen=True, eq=False)
class Point:
    """The score after so many robot minutes.

    Attributes:
        minute: robot minutes.
        score: on the held-out run.
        far: mean AUC at 0 to 25 cm, None where undefined, and the cells it is of.
        near: the same at 0 to 15 cm.
    """

    minute: int
    score: Score
    far: tuple[float | None, int]
    near: tuple[float | None, int]

    def as_json(self) -> dict[str, Any]:
        """Minute, the two means with the cells they are of, and the whole score."""
        return {
            "minute": self.minute,
            "mean_auc_0_25_cm": self.far[0],
            "cells_0_25_cm": self.far[1],
            "mean_auc_0_15_cm": self.near[0],
            "cells_0_15_cm": self.near[1],
            "score": self.score.as_json(),
        }

    def __str__(self) -> str:
        far, near = (f"{_shown(mean)} ({cells} cells)" for mean, cells in (self.far, self.near))
        return f"after {self.minute:3d} min: mean AUC {far} at 0 to 25 cm, {near} at 0 to 15 cm"


def learning_curve(exam: Exam, minutes: Iterable[tuple[int, Weights]]) -> list[Point]:
    """Try the weights of each minute on an exam."""
    points: list[Point] = []
    for minute, weights in minutes:
        score = exam.score(weights)
        points.append(Point(minute, score, _mean(score, FAR_M), _mean(score, NEAR_M)))
    return points


def _mean(score: Score, farthest_m: float) -> tuple[float | None, int]:
    mean, cells = mean_auc(score, farthest_m)
    return (mean if cells else None), cells


def _shown(value: float | None) -> str:
    return "undefined" if value is None else f"{value:.3f}"
