"""Do predicted probabilities mean what they say? Reliability curves, Brier score and expected calibration error.

Binary events: of all labels predicted with about 0.3, three in ten should be 1 (Naeini et al. 2015, Guo et al. 2017).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Bins of equal width, as in the published comparisons.
BINS = 15


class Reliability(NamedTuple):
    """Of N known labels.

    Attributes:
        predicted: (B,) mean probability in each bin; NaN where the bin is empty.
        observed: (B,) share of labels that are 1; NaN where the bin is empty.
        labels: (B,) labels in each bin.
        brier: mean squared error of the probabilities; NaN without a label.
        ece: mean distance between predicted and observed, weighted by count; NaN without a label.
    """

    predicted: Floats
    observed: Floats
    labels: NDArray[np.int64]
    brier: float
    ece: float


def reliability(probabilities: NDArray[np.floating], labels: NDArray[np.integer], bins: int = BINS) -> Reliability:
    """Compare probabilities with labels of the same shape; unknown labels (-1) do not count.

    >>> found = reliability(np.array([0.9, 0.9, 0.1, 0.5]), np.array([1, 0, 0, -1]), bins=2)
    >>> round(found.ece, 3), found.labels.tolist()
    (0.3, [1, 2])
    """
    if probabilities.shape != labels.shape:
        raise ValueError(f"expected one label a probability, got shapes {labels.shape} and {probabilities.shape}")
    known = labels >= 0
    probability, truth = probabilities[known].astype(np.float64), labels[known].astype(np.float64)
    which = np.minimum((probability * bins).astype(np.int64), bins - 1)
    count = np.bincount(which, minlength=bins)
    with np.errstate(invalid="ignore"):  # an empty bin has no mean
        predicted = np.bincount(which, probability, bins) / count
        observed = np.bincount(which, truth, bins) / count
    if not len(truth):
        return Reliability(predicted, observed, count, float("nan"), float("nan"))
    ece = float(np.nansum(count * np.abs(predicted - observed)) / len(truth))
    return Reliability(predicted, observed, count, float(np.mean((probability - truth) ** 2)), ece)
