"""Near-duplicate rejection: a robot that stands still, or drives the same corridor, must not fill its memory with it.

Each picture has an 8x8 grey thumbnail. A frame repeats another if the thumbnails differ by less than a set mean grey
difference and it has no known label that the other lacks or contradicts. All of it is in whole numbers, so that the
compiled form gives the same answers.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.buffer_kernels import KERNELS

_SIDE = 8
PIXELS = _SIDE * _SIDE
#: Only so many of the newest frames in memory are looked at: repetitions come close together, and the cost stays flat.
_LOOK_BACK = 1024
#: No frame has this id, and no slot says so either.
_GONE = -2


def thumbnail(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(64,) uint8: the means over 8x8 parts of a picture (H, W, C) and over its channels, rounded down.

    >>> thumbnail(np.full((64, 80, 3), 9, np.uint8)).tolist() == [9] * 64
    True
    """
    height, width, channels = picture.shape
    rows, columns = (np.arange(_SIDE) * size // _SIDE for size in (height, width))
    sums = np.add.reduceat(np.add.reduceat(picture.sum(2, dtype=np.int64), rows, 0), columns, 1)
    # A picture of less than eight rows shows some of them twice.
    tall, wide = (np.maximum(np.diff(np.append(start, size)), 1) for start, size in ((rows, height), (columns, width)))
    return (sums // (channels * tall[:, None] * wide)).astype(np.uint8).ravel()


def repeats(
    mine: NDArray[np.uint8],
    my_labels: NDArray[np.int8],
    thumbnails: NDArray[np.uint8],
    slots: NDArray[np.int64],
    ids: NDArray[np.int64],
    ids_now: NDArray[np.int64],
    labels: NDArray[np.int8],
    distance: float,
) -> bool:
    """Does a frame repeat one of R others?

    Args:
        mine: (64,) uint8, its thumbnail.
        my_labels: (L,) int8.
        thumbnails: (R, 64) uint8 of the others.
        slots: (R,) where their labels are.
        ids: (R,) their frame ids; one that is not in its slot any more has left, and does not count.
        ids_now: (slots,) frame id in each slot.
        labels: (slots, L) int8.
        distance: mean grey difference, of 255, below which two pictures are alike.
    """
    apart = np.abs(thumbnails.astype(np.int16) - mine.astype(np.int16)).sum(1)
    alike = labels[slots[(apart < distance * PIXELS) & (ids_now[slots] == ids)]]
    return bool(((my_labels < 0) | (my_labels == alike)).all(1).any())


class Newest:
    """The newest frames in memory: a ring of their thumbnails.

    Args:
        distance: mean grey difference, of 255, below which two pictures are alike; 0 turns the check off.
        ids: (slots,) int64 frame id in each slot, -1 where there is none; the buffer's own array.
        labels: (slots, L) int8; the buffer's own, too.
    """

    def __init__(self, distance: float, ids: NDArray[np.int64], labels: NDArray[np.int8]) -> None:
        self._distance = distance
        self._ids_now, self._labels = ids, labels
        self._thumbnails = np.zeros((_LOOK_BACK, PIXELS), np.uint8)
        self._slots = np.zeros(_LOOK_BACK, np.int64)
        self._ids = np.full(_LOOK_BACK, _GONE, np.int64)
        self._came = 0

    def repeated_by(self, slot: int, thumb: NDArray[np.uint8]) -> bool:
        """Does the frame in a slot, with this thumbnail, repeat one of them?"""
        if not self._distance:
            return False
        kernels = KERNELS.get()
        return (repeats if kernels is None else kernels.repeats)(
            thumb, self._labels[slot], self._thumbnails, self._slots, self._ids, self._ids_now, self._labels,
            self._distance,
        )  # fmt: skip

    def remember(self, slot: int, thumb: NDArray[np.uint8]) -> None:
        """A frame has entered memory."""
        place = self._came % _LOOK_BACK
        self._thumbnails[place], self._slots[place], self._ids[place] = thumb, slot, self._ids_now[slot]
        self._came += 1

    def state(self) -> dict[str, NDArray[Any]]:
        """Oldest first, as arrays for `restore`; a slot is told by its frame's id."""
        order = np.arange(self._came, self._came + _LOOK_BACK) % _LOOK_BACK
        there = self._ids_now[self._slots[order]] == self._ids[order]
        return {"newest": np.where(there, self._ids[order], _GONE), "thumbnails": self._thumbnails[order]}

    def restore(self, state: Mapping[str, NDArray[Any]], slots: Mapping[int, int]) -> None:
        """Hold what `state` gave; `slots` has the slot of each frame id."""
        self._came = 0
        if "newest" not in state:  # older checkpoints lack it: what repeats those frames may stay
            self._ids[:] = _GONE
            return
        self._ids[:], self._thumbnails[:] = state["newest"], state["thumbnails"]
        self._slots[:] = [slots.get(frame_id, 0) for frame_id in self._ids.tolist()]
