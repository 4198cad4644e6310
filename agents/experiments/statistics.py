"""Medians with intervals, by resampling whole runs."""

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
