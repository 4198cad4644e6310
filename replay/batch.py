"""What is learned from at once: rows of larger arrays, not copied until someone looks at them."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class Frames(NamedTuple):
    """Labelled pictures, M of them.

    Attributes:
        pictures: (M, H, W, C) uint8.
        labels: (M, T, S) int8: 1, 0, -1 unknown.
        weight: (M, T, S) float32 in [0, 1].
    """

    pictures: NDArray[np.uint8]
    labels: NDArray[np.int8]
    weight: NDArray[np.float32]


class Batch:
    """N frames to learn from: rows of arrays that may hold many more, as the replay buffer's do.

    What a batch shows is copied out of those arrays when asked for; who works through them row by row takes `frames`
    and `rows`, and spares the copy. A batch drawn from a buffer is good until the buffer changes.

    Args:
        pictures: (M, H, W, C) uint8.
        labels: (M, T, S) int8.
        weight: (M, T, S) float32.
        rows: (N,) int64, which of them make up the batch; left out: all, and then nothing is copied.

    >>> numbers = np.arange(3)
    >>> Batch(numbers.reshape(3, 1, 1, 1), numbers.reshape(3, 1, 1), numbers.reshape(3, 1, 1), np.array([2, 2])).labels
    array([[[2]],
    <BLANKLINE>
           [[2]]])
    """

    def __init__(
        self,
        pictures: NDArray[np.uint8],
        labels: NDArray[np.int8],
        weight: NDArray[np.float32],
        rows: NDArray[np.int64] | None = None,
    ) -> None:
        self.frames = Frames(pictures, labels, weight)
        self.rows = np.arange(len(pictures)) if rows is None else rows
        self._all = rows is None

    def __len__(self) -> int:
        """How many frames."""
        return len(self.rows)

    @property
    def pictures(self) -> NDArray[np.uint8]:
        """(N, H, W, C) uint8."""
        return self._gathered(self.frames.pictures)

    @property
    def labels(self) -> NDArray[np.int8]:
        """(N, T, S) int8: 1, 0, -1 unknown."""
        return self._gathered(self.frames.labels)

    @property
    def weight(self) -> NDArray[np.float32]:
        """(N, T, S) float32 in [0, 1]."""
        return self._gathered(self.frames.weight)

    def _gathered(self, array: NDArray[Any]) -> NDArray[Any]:
        return array if self._all else array.take(self.rows, axis=0)
