"""How many labels of each class the kept frames have: what balances the memory and the loss.

Rows of L labels, one for each target and sensor: -1 is unknown and never counted.
"""

import numpy as np
from numpy.typing import NDArray

Counts = NDArray[np.int64]


def tally(labels: NDArray[np.int8], sign: int, counts: Counts) -> None:
    """Count a frame's labels (L,) in, with `sign` 1, or out, with -1; `counts` is (2, L): negatives, positives.

    >>> counts = np.zeros((2, 3), np.int64)
    >>> tally(np.array([0, 1, -1], np.int8), 1, counts)
    >>> counts.tolist()
    [[1, 0, 0], [0, 1, 0]]
    """
    counts[0] += sign * (labels == 0)
    counts[1] += sign * (labels == 1)


def replace(
    slots: NDArray[np.int64],
    new_labels: NDArray[np.int8],
    new_weight: NDArray[np.float32],
    labels: NDArray[np.int8],
    weight: NDArray[np.float32],
    counts: Counts,
) -> None:
    """Write rows of labels and weights over those in some slots, in order, and keep the counts right.

    Args:
        slots: (M,) which; one below 0 is passed over.
        new_labels: (M, L) int8.
        new_weight: (M, L) float32.
        labels: (slots, L), written to.
        weight: (slots, L), written to.
        counts: (2, L), of all that is in `labels`.
    """
    for slot, row_labels, row_weight in zip(slots, new_labels, new_weight, strict=True):
        if slot >= 0:
            tally(labels[slot], -1, counts)
            tally(row_labels, 1, counts)
            labels[slot], weight[slot] = row_labels, row_weight
