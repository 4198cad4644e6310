"""AUC of many resamples of the same predictions: sorted once, each resample is a walk along the ranks.

A resample says how often each frame counts. Along the ascending scores, the negatives passed so far are what a positive
wins against; so one pass gives the AUC of all resamples, and no pair is looked at. All sums are of integers, so the
compiled walk (`llrp_online.resampling_kernels`) and the plain one give the same numbers.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from replay.compiling import Compiled

_KERNELS = Compiled("llrp_online.resampling_kernels")


class Ranking(NamedTuple):
    """One cell's known labels by ascending score.

    Attributes:
        rows: (K,) int64, of the frames.
        scores: (K,) float32 or float64, ascending.
        positive: (K,) bool.
    """

    rows: NDArray[np.int64]
    scores: NDArray[np.floating[Any]]
    positive: NDArray[np.bool_]


class Won(NamedTuple):
    """What each of R resamples counts, (R,) int64 each.

    Attributes:
        twice: two for each pair of a positive that scores more than a negative, one for each that scores the same.
        positives: positives drawn.
        negatives: negatives drawn.
    """

    twice: NDArray[np.int64]
    positives: NDArray[np.int64]
    negatives: NDArray[np.int64]


def ranking(scores: NDArray[np.floating[Any]], labels: NDArray[np.int8]) -> Ranking:
    """Rank one cell: scores (N,), labels (N,) of 1, 0 or -1 unknown; ties by row."""
    kernels = _KERNELS.get()
    if kernels is None or scores.dtype != np.float32:
        return plain_ranking(scores, labels)
    return Ranking(*kernels.rank(np.ascontiguousarray(scores), np.ascontiguousarray(labels)))


def plain_ranking(scores: NDArray[np.floating[Any]], labels: NDArray[np.int8]) -> Ranking:
    """The plain form of `ranking`, the reference."""
    known = np.flatnonzero(labels >= 0)
    values = scores[known].astype(np.float32 if scores.dtype == np.float32 else np.float64)
    order = np.argsort(values, kind="stable")
    rows = known[order]
    return Ranking(rows, values[order], labels[rows] == 1)


def resampled_auc(ranked: Ranking, times: NDArray[np.int32]) -> NDArray[np.float64]:
    """AUC with frame `n` counted `times[n, r]` times in resample `r`: (N, R) -> (R,), NaN where a class is not drawn.

    >>> ranked = ranking(np.array([0.1, 0.4, 0.4, 0.8]), np.array([0, 0, 1, 1], np.int8))
    >>> resampled_auc(ranked, np.array([[1, 0], [1, 2], [1, 1], [1, 0]], np.int32))
    array([0.875, 0.5  ])
    """
    kernels = _KERNELS.get()
    won = plain_pairs_won(ranked, times) if kernels is None else Won(*kernels.pairs_won(*ranked, times))
    pairs = won.positives * won.negatives
    return np.divide(won.twice, 2 * pairs, out=np.full(len(pairs), np.nan), where=pairs > 0)


def plain_pairs_won(ranked: Ranking, times: NDArray[np.int32]) -> Won:
    """The plain walk, the reference: running sums of negatives, looked up for each positive."""
    rows, scores, positive = ranked
    negatives = np.zeros((len(rows) - int(positive.sum()) + 1, times.shape[1]), np.int64)
    np.cumsum(times[rows[~positive]], axis=0, out=negatives[1:])
    below = np.searchsorted(scores[~positive], scores[positive], "left")
    not_above = np.searchsorted(scores[~positive], scores[positive], "right")
    positives = times[rows[positive]].astype(np.int64)
    twice = (positives * (negatives[below] + negatives[not_above])).sum(0)
    return Won(twice, positives.sum(0), negatives[-1])
