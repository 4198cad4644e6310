"""Medians, means and ratios with intervals, by resampling whole runs, or groups of runs that have much in common."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_ROUNDS = 2000


def median(
    values: Sequence[float] | NDArray[np.float64], groups: Sequence[object] | None = None
) -> tuple[float, tuple[float, float]]:
    """The median and its 95 % percentile interval over 2,000 resamples of the values.

    Args:
        values: at least one.
        groups: which group each is of: whole groups are drawn, since values of one are no independent witnesses; None:
            each value is a group of its own.

    >>> median([0.8, 0.9, 0.85])
    (0.85, (0.8, 0.9))
    >>> median([0.5, 1.0, 0.75, 0.75], ["wood", "wood", "tiles", "tiles"])
    (0.75, (0.75, 0.75))
    """
    array = np.asarray(values, np.float64)
    if not len(array):
        raise ValueError("median: expected at least one value, got none")
    if groups is None:
        return float(np.median(array)), _interval(np.median(array[_drawn(len(array))], axis=1))
    if len(groups) != len(array):
        raise ValueError(f"median: expected a group for each of {len(array)} values, got {len(groups)}")
    members = [array[[one == group for one in groups]] for group in dict.fromkeys(groups)]
    drawn = [np.median(np.concatenate([members[group] for group in some])) for some in _drawn(len(members))]
    return float(np.median(array)), _interval(np.array(drawn))


def mean(values: Sequence[float] | NDArray[np.float64]) -> tuple[float, tuple[float, float]]:
    """The mean and its interval: of counts that are nought in most runs, whose median would say nothing.

    >>> mean([0.0, 0.0, 3.0])
    (1.0, (0.0, 3.0))
    """
    array = np.asarray(values, np.float64)
    if not len(array):
        raise ValueError("mean: expected at least one value, got none")
    return float(array.mean()), _interval(array[_drawn(len(array))].mean(1))


def ratio(
    above: Sequence[float] | NDArray[np.float64], below: Sequence[float] | NDArray[np.float64]
) -> tuple[float | None, tuple[float, float] | None]:
    """The ratio of two sums over the same runs, and its interval over resampled runs; None where nothing is below.

    Of counts that are nought in half of the runs, whose medians would say nothing.

    >>> ratio([1.0, 2.0], [10.0, 10.0])
    (0.15, (0.1, 0.2))
    """
    over, under = np.asarray(above, np.float64), np.asarray(below, np.float64)
    if not len(over) or over.shape != under.shape:
        raise ValueError(f"ratio: expected pairs, at least one, got {len(over)} above and {len(under)} below")
    drawn = _drawn(len(over))
    divisors = under[drawn].sum(1)
    if not under.sum() or not divisors.all():
        return None, None
    return float(over.sum() / under.sum()), _interval(over[drawn].sum(1) / divisors)


def _drawn(runs: int) -> NDArray[np.int64]:
    """(rounds, runs): which runs make up each round."""
    return np.random.default_rng(0).integers(0, runs, (_ROUNDS, runs))


def _interval(values: NDArray[np.float64]) -> tuple[float, float]:
    low, high = np.percentile(values, [2.5, 97.5])
    return float(low), float(high)
