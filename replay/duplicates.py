"""Near-duplicate rejection: a robot that stands still, or drives the same corridor, must not fill its memory with it.

Each picture has an 8x8 grey thumbnail. A frame repeats another if the thumbnails differ by less than a set mean grey
difference and it has no known label that the other lacks or contradicts.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

_SIDE = 8
#: Only so many of the newest frames in memory are looked at: repetitions come close together, and the cost stays flat.
_LOOK_BACK = 1024


class Thumbnails:
    """Thumbnails by slot.

    Args:
        capacity: slots.
        distance: mean grey difference, of 255, below which two pictures are alike; 0 turns the check off.
    """

    ROW_BYTES = _SIDE * _SIDE

    def __init__(self, capacity: int, distance: float) -> None:
        self._distance = distance
        self._rows = np.zeros((capacity, _SIDE * _SIDE), np.uint8)

    def put(self, slot: int, picture: NDArray[np.uint8]) -> None:
        """Keep the thumbnail of a picture (H, W, C) uint8; several cameras are averaged."""
        small = cv2.resize(picture, (_SIDE, _SIDE), interpolation=cv2.INTER_AREA)
        self._rows[slot] = np.asarray(small).reshape(_SIDE * _SIDE, -1).mean(1).astype(np.uint8)

    def repeats(self, slot: int, others: NDArray[np.int64], labels: NDArray[np.int8]) -> bool:
        """Does the frame in `slot` repeat one of `others` (slots, newest last)? `labels` is (slots, T, S) int8."""
        if not self._distance or not len(others):
            return False
        others = others[-_LOOK_BACK:]
        apart = np.abs(self._rows[others].astype(np.int16) - self._rows[slot].astype(np.int16)).mean(1)
        alike = others[apart < self._distance]
        mine = labels[slot]
        return bool(((mine < 0) | (mine == labels[alike])).all((1, 2)).any())
