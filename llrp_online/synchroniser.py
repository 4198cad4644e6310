"""One frame from several cameras: the pictures taken nearest in time to each picture of the first camera."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from llrp_online.events import Picture

#: Pictures a camera may be ahead of the others; older ones have lost their partners.
_PENDING = 8


@dataclass(frozen=True, eq=False)
class Frame:
    """What all cameras saw at one moment.

    Attributes:
        t_ns: time of the first camera's picture.
        picture: (H, W, 3 * cameras) uint8, RGB of each camera in turn.
    """

    t_ns: int
    picture: NDArray[np.uint8]


class Synchroniser:
    """Pictures in, frames out; with one camera every picture is a frame.

    Args:
        cameras: how many.
        tolerance_s: pictures further apart than this do not belong together.

    >>> sync = Synchroniser(cameras=2, tolerance_s=0.02)
    >>> grey = lambda value: np.full((1, 1, 3), value, np.uint8)
    >>> sync.add(Picture(0, 0, grey(1))), sync.add(Picture(10_000_000, 1, grey(2)))[0].picture.ravel().tolist()
    ([], [1, 1, 1, 2, 2, 2])
    """

    def __init__(self, cameras: int, tolerance_s: float) -> None:
        self._tolerance_ns = round(tolerance_s * 1e9)
        self._pending: list[deque[Picture]] = [deque() for _ in range(cameras)]
        self.unmatched = 0

    def add(self, picture: Picture) -> list[Frame]:
        """Take in a picture; the frames it completes."""
        if len(self._pending) == 1:
            return [Frame(picture.t_ns, picture.pixels)]
        mine = self._pending[picture.camera]
        mine.append(picture)
        if len(mine) > _PENDING:
            mine.popleft()
            self.unmatched += 1
        frames: list[Frame] = []
        for first in list(self._pending[0]):
            partners = [self._partner(first.t_ns, pending) for pending in self._pending[1:]]
            if all(partner is not None for partner in partners):
                pictures = [first, *(partner for partner in partners if partner is not None)]
                for pending, used in zip(self._pending, pictures, strict=True):
                    pending.remove(used)
                frames.append(Frame(first.t_ns, np.concatenate([p.pixels for p in pictures], -1)))
        return frames

    def state(self) -> dict[str, NDArray[Any]]:
        """The pictures that wait, as arrays for `restore`; empty where none does."""
        waiting = [picture for pending in self._pending for picture in pending]
        if not waiting:
            return {}
        return {
            "t_ns": np.array([picture.t_ns for picture in waiting], np.int64),
            "camera": np.array([picture.camera for picture in waiting], np.int64),
            "pixels": np.stack([picture.pixels for picture in waiting]),
        }

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Wait for the partners of the pictures that `state` gave, and of no others."""
        self.clear()
        if state:
            for t_ns, camera, pixels in zip(state["t_ns"], state["camera"], state["pixels"], strict=True):
                self._pending[camera].append(Picture(int(t_ns), int(camera), pixels))

    def clear(self) -> None:
        """Forget the pictures that wait: nothing that comes belongs to them."""
        for pending in self._pending:
            pending.clear()

    def _partner(self, t_ns: int, pending: deque[Picture]) -> Picture | None:
        nearest = min(pending, key=lambda picture: abs(picture.t_ns - t_ns), default=None)
        if nearest is None or abs(nearest.t_ns - t_ns) > self._tolerance_ns:
            return None
        return nearest
