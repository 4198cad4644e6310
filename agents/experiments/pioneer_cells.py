"""What several trials of the Pioneer say together of each cell: means, and intervals from the same draws."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from agents.experiments.pioneer_published import Published
from agents.experiments.trial import Result

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
_INTERVAL = [2.5, 97.5]
#: Targets are computed, so equal ones differ in their last bits.
_SAME_M = 1e-6


@dataclass(frozen=True, eq=False)
class Cells:
    """Of T targets.

    Attributes:
        targets: (T, 3) float64 poses.
        auc: (T,) float64, mean over the trials that have one; NaN where none has.
        rounds: (R, T) float64, the same of each round of bootstrap.
        n_pos: (T,) int64 known dark labels of the maps tested, each map counted once.
        n_neg: (T,) int64, bright ones.
        known: (T,) int64 known labels of all maps, learned from or tested.
        trajectories: tested, each counted once.
        runs: in words, how many trials.
    """

    targets: Floats
    auc: Floats
    rounds: Floats
    n_pos: Ints
    n_neg: Ints
    known: Ints
    trajectories: int
    runs: str

    @classmethod
    def of(cls, targets: Floats, results: Sequence[Result], seeds: int) -> Self:
        """From the results of `pioneer_learning.exam`: seed by seed, in each seed a trial for each half of the maps."""
        halves = results[: len(results) // seeds]
        n_pos, n_neg = (
            sum((np.array(one[name], np.int64) for one in halves), np.int64(0)) for name in ("n_pos", "n_neg")
        )
        first = halves[0]
        known = np.array(first["learned"], np.int64) + np.array(first["n_pos"]) + np.array(first["n_neg"])
        return cls(
            targets,
            _mean([np.array(one["auc"], np.float64) for one in results]),
            _mean([np.array(one["rounds"], np.float64) for one in results]),
            np.asarray(n_pos),
            np.asarray(n_neg),
            known,
            sum(one["trajectories"] for one in halves),
            f"{len(halves)} halves x {seeds} seed{'s' if seeds > 1 else ''}",
        )

    def at(self, x_m: float, y_m: float) -> NDArray[np.bool_]:
        """(T,) which target lies there."""
        return (np.hypot(self.targets[:, 0] - x_m, self.targets[:, 1] - y_m) < _SAME_M).astype(np.bool_)

    def mean(self, chosen: NDArray[np.bool_]) -> tuple[float | None, tuple[float, float] | None, int]:
        """Mean AUC over the chosen cells that have one, its 95 % interval, and how many cells that are."""
        defined = chosen & ~np.isnan(self.auc)
        if not defined.any():
            return None, None, 0
        # A cell that loses a class in a round sits that round out.
        drawn = self.rounds[:, defined]
        seen = ~np.isnan(drawn)
        each = np.where(seen, drawn, 0.0).sum(1)[seen.any(1)] / seen.sum(1)[seen.any(1)]
        interval = None
        if len(each):
            low, high = np.percentile(each, _INTERVAL)
            interval = float(low), float(high)
        return float(self.auc[defined].mean()), interval, int(defined.sum())

    def as_json(self, paper: Published) -> list[dict[str, Any]]:
        """One object a cell, beside the paper's; None where undefined."""
        told: list[dict[str, Any]] = []
        for target, (x_m, y_m, _) in enumerate(self.targets.tolist()):
            value, interval, _ = self.mean(np.arange(len(self.targets)) == target)
            theirs = float(paper.auc[target])
            told.append(
                {
                    "x_m": x_m,
                    "y_m": y_m,
                    "auc": value,
                    "low": None if interval is None else interval[0],
                    "high": None if interval is None else interval[1],
                    "n_pos": int(self.n_pos[target]),
                    "n_neg": int(self.n_neg[target]),
                    "known_labels": int(self.known[target]),
                    "paper_auc": None if np.isnan(theirs) else theirs,
                    "paper_known_labels": int(paper.known_labels[target]),
                }
            )
        return told


def _mean(values: Sequence[Floats]) -> Floats:
    """Over what is defined; NaN where nothing is."""
    stacked = np.stack(values)
    known = ~np.isnan(stacked)
    total = np.where(known, stacked, 0.0).sum(0)
    return np.divide(total, known.sum(0), out=np.full(total.shape, np.nan), where=known.any(0))
