"""The held-out slice: recent frames kept back from training, to judge new weights by.

Frames come in runs of near-twins, so they are kept back in blocks of time, not one by one. The slice holds the newest;
a frame that it has no more room for is handed on, to be trained on after all: nothing is lost, only delayed.
"""

from collections import OrderedDict
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.batch import Batch


@dataclass(frozen=True, eq=False)
class HeldFrame:
    """A labelled frame: picture (H, W, C) uint8, labels (T, S) int8, weight (T, S) float32."""

    frame_id: int
    picture: NDArray[np.uint8]
    labels: NDArray[np.int8]
    weight: NDArray[np.float32]


class HeldOut:
    """The slice.

    Args:
        share: of all frames to keep back; 0 keeps none.
        block_s: length of a block of kept-back frames.
        capacity: newest frames that judge.

    >>> held = HeldOut(share=0.5, block_s=1.0, capacity=10)
    >>> [held.wants(t_s * 1_000_000_000) for t_s in range(4)]
    [False, True, False, True]
    """

    def __init__(self, share: float, block_s: float, capacity: int) -> None:
        self._period = round(1 / share) if share else 0
        self._block_ns = round(block_s * 1e9)
        self._capacity = capacity
        self._start_ns: int | None = None
        self._frames: OrderedDict[int, HeldFrame] = OrderedDict()

    def __len__(self) -> int:
        """Frames kept back now."""
        return len(self._frames)

    def __contains__(self, frame_id: int) -> bool:
        """Is the frame kept back?"""
        return frame_id in self._frames

    def wants(self, t_ns: int) -> bool:
        """Does a frame of this time fall into a block kept back? The last block of each period does."""
        if not self._period:
            return False
        self._start_ns = t_ns if self._start_ns is None else self._start_ns
        return (t_ns - self._start_ns) // self._block_ns % self._period == self._period - 1

    def put(self, frame: HeldFrame) -> HeldFrame | None:
        """Keep a frame, or its newer labels; the frame that must leave for it, if any."""
        self._frames[frame.frame_id] = frame
        if len(self._frames) > self._capacity:
            return self._frames.popitem(last=False)[1]
        return None

    def get(self, frame_id: int) -> HeldFrame | None:
        """A frame kept back; None if it is not."""
        return self._frames.get(frame_id)

    def state(self) -> dict[str, NDArray[Any]]:
        """All of them, and where the blocks begin, as arrays for `restore`; empty before the first frame."""
        if self._start_ns is None:
            return {}
        start = {"start_ns": np.array([self._start_ns], np.int64)}
        batch = self.batch()
        if batch is None:
            return start
        ids = np.array(list(self._frames), np.int64)
        return {**start, "ids": ids, "pictures": batch.pictures, "labels": batch.labels, "weight": batch.weight}

    def restore(self, state: dict[str, NDArray[Any]]) -> None:
        """Hold what `state` gave, and nothing else."""
        self._frames.clear()
        self._start_ns = int(state["start_ns"][0]) if state else None
        if "ids" not in state:
            return
        rows = zip(state["ids"], state["pictures"], state["labels"], state["weight"], strict=True)
        for frame_id, picture, labels, weight in rows:
            self._frames[int(frame_id)] = HeldFrame(int(frame_id), picture, labels, weight)

    def batch(self) -> Batch | None:
        """All of them, or None."""
        if not self._frames:
            return None
        frames = self._frames.values()
        return Batch(
            np.stack([f.picture for f in frames]),
            np.stack([f.labels for f in frames]),
            np.stack([f.weight for f in frames]),
        )
