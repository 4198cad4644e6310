"""How well predictions rank: the area under the ROC curve (AUC) for every target and sensor, with intervals.

Nava et al. 2019, section IV-F. The AUC is the probability that a positive scores above a negative, a tie counting one
half; it is computed exactly, from ranks. Unknown labels (-1) are left out; a cell with one class has no AUC (NaN).
Label weights play no part.

Shapes: scores (N, T, S) float; labels (N, T, S) int8 of 1, 0 or -1.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from llrp_online.resampling import Ranking, ranking, resampled_auc

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Scores = NDArray[np.floating[Any]]
Labels = NDArray[np.int8]

# Bootstrap rounds done at once: bounds its memory at less than 1 kB a frame.
_ROUNDS_AT_ONCE = 50


@dataclass(frozen=True, eq=False)
class Score:
    """AUC of every target and sensor.

    Attributes:
        targets: (T, 3) float64 `[x_m, y_m, yaw_rad]`.
        sensors: (S,) names.
        auc: (T, S) float64, NaN where one class is missing.
        low: (T, S) float64, lower end of the 95 % interval; NaN where undefined or not asked for.
        high: (T, S) float64, its upper end.
        n_pos: (T, S) int64, known positives.
        n_neg: (T, S) int64, known negatives.
        pooled_auc: of all known labels together; NaN where one class is missing.

    >>> score = Score.of(np.array([[[0.2]], [[0.7]]]), np.array([[[0]], [[1]]], np.int8), np.zeros((1, 3)), ["ahead"])
    >>> score.as_json()["auc"], score.as_json()["low"]
    ([[1.0]], [[None]])
    """

    targets: Floats
    sensors: tuple[str, ...]
    auc: Floats
    low: Floats
    high: Floats
    n_pos: Ints
    n_neg: Ints
    pooled_auc: float

    @classmethod
    def of(
        cls,
        scores: Scores,
        labels: Labels,
        targets: Floats,
        sensors: Sequence[str],
        *,
        rounds: int = 0,
        seed: int = 0,
    ) -> "Score":
        """The score of predictions; with `rounds` of bootstrap, or without intervals."""
        n_pos, n_neg = counts(labels)
        blank = np.full(n_pos.shape, np.nan)
        rankings, shape = _rankings(scores, labels), n_pos.shape
        low, high = _intervals(rankings, len(labels), shape, rounds, seed) if rounds else (blank, blank)
        found = _auc(rankings, len(labels), shape)
        return cls(targets, tuple(sensors), found, low, high, n_pos, n_neg, pooled_auc(scores, labels))

    def as_json(self) -> dict[str, Any]:
        """The same in plain lists, None where undefined."""
        return {
            "targets": self.targets.tolist(),
            "sensors": list(self.sensors),
            "auc": _nullable(self.auc),
            "low": _nullable(self.low),
            "high": _nullable(self.high),
            "n_pos": self.n_pos.tolist(),
            "n_neg": self.n_neg.tolist(),
            "pooled_auc": None if math.isnan(self.pooled_auc) else self.pooled_auc,
        }

    @classmethod
    def of_json(cls, told: Mapping[str, Any]) -> "Score":
        """From what `as_json` told."""
        floats = {name: np.array(told[name], np.float64) for name in ("targets", "auc", "low", "high")}
        pooled = told["pooled_auc"]
        return cls(
            **floats,
            sensors=tuple(told["sensors"]),
            n_pos=np.array(told["n_pos"], np.int64),
            n_neg=np.array(told["n_neg"], np.int64),
            pooled_auc=math.nan if pooled is None else pooled,
        )


def counts(labels: Labels) -> tuple[Ints, Ints]:
    """Known positives and negatives: (N, T, S) -> (T, S), (T, S)."""
    return (labels == 1).sum(0, dtype=np.int64), (labels == 0).sum(0, dtype=np.int64)


def auc(scores: Scores, labels: Labels) -> Floats:
    """(N, T, S), (N, T, S) -> (T, S), NaN where one class is missing.

    >>> auc(np.array([[[0.1]], [[0.4]], [[0.4]], [[0.8]]]), np.array([[[0]], [[0]], [[1]], [[1]]], np.int8))
    array([[0.875]])
    """
    return _auc(_rankings(scores, labels), len(labels), labels.shape[1:])


def pooled_auc(scores: Scores, labels: Labels) -> float:
    """One AUC over all known labels together, NaN if one class is missing. Any shape, the same for both."""
    return float(auc(scores.reshape(-1, 1, 1), labels.reshape(-1, 1, 1))[0, 0])


def bootstrap(scores: Scores, labels: Labels, rounds: int = 100, seed: int = 0) -> tuple[Floats, Floats]:
    """95 % percentile intervals of the AUC by resampling frames: (T, S), (T, S), NaN where there is no AUC.

    Every round draws N frames with replacement, the same for all cells, so labels of one frame stay together. A round
    in which a cell loses a class does not count for it.
    """
    return _intervals(_rankings(scores, labels), len(labels), labels.shape[1:], rounds, seed)


def _rankings(scores: Scores, labels: Labels) -> list[Ranking]:
    """Every cell's, in the order of targets, then sensors."""
    if scores.shape != labels.shape:
        raise ValueError(f"scores and labels: expected the same shape, got {scores.shape} and {labels.shape}")
    if not (np.isfinite(scores) | (labels < 0)).all():
        raise ValueError("scores: expected finite numbers wherever the label is known, got NaN or infinity")
    # One cell's numbers side by side: ranking reads them several times.
    columns = (np.ascontiguousarray(np.moveaxis(array, 0, -1)) for array in (scores, labels))
    flat = (column.reshape(np.prod(labels.shape[1:], dtype=int), -1) for column in columns)
    return [ranking(score, truth) for score, truth in zip(*flat, strict=True)]


def _auc(rankings: list[Ranking], count: int, shape: tuple[int, ...]) -> Floats:
    once = np.ones((count, 1), np.int32)
    return np.array([resampled_auc(ranked, once)[0] for ranked in rankings]).reshape(shape)


def _intervals(
    rankings: list[Ranking], count: int, shape: tuple[int, ...], rounds: int, seed: int
) -> tuple[Floats, Floats]:
    drawn = np.empty((len(rankings), rounds))
    rng = np.random.default_rng(seed)
    for start in range(0, rounds, _ROUNDS_AT_ONCE):
        end = min(start + _ROUNDS_AT_ONCE, rounds)
        times = np.empty((count, end - start), np.int32)
        for column in times.T:
            column[:] = np.bincount(rng.integers(0, count, count), minlength=count)
        for cell, ranked in enumerate(rankings):
            drawn[cell, start:end] = resampled_auc(ranked, times)
    low, high = (_quantile(drawn, share).reshape(shape) for share in (0.025, 0.975))
    return low, high


def _quantile(values: Floats, share: float) -> Floats:
    """Of each row of (cells, rounds), between the two nearest of the numbers in it; NaN where there is none."""
    ascending = np.sort(values, -1)  # NaN last
    position = share * ((~np.isnan(values)).sum(-1, keepdims=True) - 1)
    below = np.floor(position).astype(np.int64)
    low, high = (np.take_along_axis(ascending, index, -1) for index in (below, np.ceil(position).astype(np.int64)))
    return (low + (high - low) * (position - below))[:, 0]


def _nullable(values: Floats) -> list[list[float | None]]:
    return [[None if math.isnan(value) else value for value in row] for row in values.tolist()]
