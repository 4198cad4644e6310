"""How well predictions rank: the area under the ROC curve (AUC) for every target and sensor, with intervals.

Nava et al. 2019, section IV-F. The AUC is the probability that a positive scores above a negative, a tie counting one
half; it is computed exactly, from ranks. Unknown labels (-1) are left out; a cell with one class has no AUC (NaN).
Label weights play no part.

Shapes: scores (N, T, S) float; labels (N, T, S) int8 of 1, 0 or -1.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
        low, high = bootstrap(scores, labels, rounds, seed) if rounds else (blank, blank)
        pooled = pooled_auc(scores, labels)
        return cls(targets, tuple(sensors), auc(scores, labels), low, high, n_pos, n_neg, pooled)

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
    found = np.full(labels.shape[1:], np.nan)
    for cell, ranked in _cells(scores, labels):
        found[cell] = ranked.auc()
    return found


def pooled_auc(scores: Scores, labels: Labels) -> float:
    """One AUC over all known labels together, NaN if one class is missing. Any shape, the same for both."""
    return float(auc(scores.reshape(-1, 1, 1), labels.reshape(-1, 1, 1))[0, 0])


def bootstrap(scores: Scores, labels: Labels, rounds: int = 100, seed: int = 0) -> tuple[Floats, Floats]:
    """95 % percentile intervals of the AUC by resampling frames: (T, S), (T, S), NaN where there is no AUC.

    Every round draws N frames with replacement, the same for all cells, so labels of one frame stay together. A round
    in which a cell loses a class does not count for it.
    """
    count = len(labels)
    cells = dict(_cells(scores, labels))
    drawn: dict[tuple[int, int], list[Floats]] = {cell: [] for cell in cells}
    rng = np.random.default_rng(seed)
    for start in range(0, rounds, _ROUNDS_AT_ONCE):
        times = np.empty((count, min(_ROUNDS_AT_ONCE, rounds - start)), np.int32)
        for column in times.T:
            column[:] = np.bincount(rng.integers(0, count, count), minlength=count)
        for cell, ranked in cells.items():
            drawn[cell].append(ranked.resampled(times))
    low, high = np.full(labels.shape[1:], np.nan), np.full(labels.shape[1:], np.nan)
    for cell, parts in drawn.items():
        defined = np.concatenate(parts)
        defined = defined[~np.isnan(defined)]
        if len(defined):
            low[cell], high[cell] = np.percentile(defined, [2.5, 97.5])
    return low, high


@dataclass(frozen=True, eq=False)
class _Ranked:
    """One cell, sorted once.

    Attributes:
        positive: rows of the positives.
        negative: rows of the negatives, by ascending score.
        below: for each positive, how many negatives score less.
        not_above: for each positive, how many score less or the same.
    """

    positive: NDArray[np.intp]
    negative: NDArray[np.intp]
    below: NDArray[np.intp]
    not_above: NDArray[np.intp]

    def auc(self) -> float:
        wins_twice = int(self.below.sum()) + int(self.not_above.sum())
        return wins_twice / (2 * len(self.positive) * len(self.negative))

    def resampled(self, times: NDArray[np.int32]) -> Floats:
        """AUC with each row counted `times` (N, rounds) -> (rounds,), NaN where a class is not drawn."""
        negatives = np.zeros((len(self.negative) + 1, times.shape[1]), np.int32)
        np.cumsum(times[self.negative], axis=0, out=negatives[1:])
        positives = times[self.positive]
        wins_twice = np.einsum("nr,nr->r", positives, negatives[self.below] + negatives[self.not_above], dtype=np.int64)
        pairs = positives.sum(0, dtype=np.int64) * negatives[-1]
        return np.divide(wins_twice, 2 * pairs, out=np.full(len(pairs), np.nan), where=pairs > 0)


def _cells(scores: Scores, labels: Labels) -> Iterator[tuple[tuple[int, int], _Ranked]]:
    """Every cell (target, sensor) that has both classes, ranked."""
    if scores.shape != labels.shape:
        raise ValueError(f"scores and labels: expected the same shape, got {scores.shape} and {labels.shape}")
    if not np.isfinite(scores[labels >= 0]).all():
        raise ValueError("scores: expected finite numbers wherever the label is known, got NaN or infinity")
    for target, sensor in np.ndindex(*labels.shape[1:]):
        truth, score = labels[:, target, sensor], scores[:, target, sensor]
        positive, negative = np.flatnonzero(truth == 1), np.flatnonzero(truth == 0)
        if not len(positive) or not len(negative):
            continue
        negative = negative[np.argsort(score[negative])]
        ascending = score[negative]
        below = np.searchsorted(ascending, score[positive], "left")
        not_above = np.searchsorted(ascending, score[positive], "right")
        yield (target, sensor), _Ranked(positive, negative, below, not_above)


def _nullable(values: Floats) -> list[list[float | None]]:
    return [[None if math.isnan(value) else value for value in row] for row in values.tolist()]
