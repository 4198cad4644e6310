"""Medians, and ratios of medians, with intervals: by resampling whole runs."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_ROUNDS = 2000


def median(values: Sequence[float] | NDArray[np.float64]) -> tuple[float, tuple[float, float]]:
    """The median and its 95 % percentile interval over 2,000 resamples of the values.

    >>> median([0.8, 0.9, 0.85])
    (0.85, (0.8, 0.9))
    """
    array = np.asarray(values, np.float64)
    if not len(array):
        raise ValueError("median: expected at least one value, got none")
    drawn = np.random.default_rng(0).integers(0, len(array), (_ROUNDS, len(array)))
    low, high = np.percentile(np.median(array[drawn], axis=1), [2.5, 97.5])
    return float(np.median(array)), (float(low), float(high))


def ratio(
    part: Sequence[float] | NDArray[np.float64], whole: Sequence[float] | NDArray[np.float64]
) -> tuple[float, tuple[float, float]]:
    """The median of `part` over that of `whole`, a value each a run; and its 95 % percentile interval.

    Runs are resampled, so that what belongs together stays together.

    >>> ratio([1.0, 3.0, 2.5], [4.0, 4.0, 4.0])
    (0.625, (0.25, 0.75))
    """
    parts, wholes = np.asarray(part, np.float64), np.asarray(whole, np.float64)
    if not len(parts) or parts.shape != wholes.shape:
        raise ValueError(f"ratio: expected as many parts as wholes, at least one, got {len(parts)} and {len(wholes)}")
    drawn = np.random.default_rng(0).integers(0, len(parts), (_ROUNDS, len(parts)))
    with np.errstate(divide="ignore", invalid="ignore"):
        found = np.median(parts[drawn], axis=1) / np.median(wholes[drawn], axis=1)
    low, high = np.nanpercentile(found, [2.5, 97.5])
    return float(np.median(parts) / np.median(wholes)), (float(low), float(high))
