"""The replay buffer's arrays: a picture, its labels and their weights in each slot, and the count of every label."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay import class_counts
from replay.batch import Batch
from replay.buffer_kernels import KERNELS

#: Frames are handed out for saving in parts of about so many bytes: what saving needs beside the store itself.
_SHARD_BYTES = 1 << 25


class FrameStore:
    """Frames by slot, with room for a fixed number of them. It takes memory only as it fills.

    Args:
        capacity: slots; MemoryError if there is no room for so many.
        picture_shape: (H, W, C).
        label_shape: (T, S).

    Attributes:
        frame_bytes: what one frame takes.
        pictures: (slots, H, W, C) uint8.
        labels: (slots, T * S) int8.
        weight: (slots, T * S) float32.
        counts: (2, T * S) known labels over all frames: negatives, positives.
    """

    def __init__(self, capacity: int, picture_shape: tuple[int, int, int], label_shape: tuple[int, int]) -> None:
        self._label_shape = label_shape
        entries = int(np.prod(label_shape))
        self.frame_bytes = bytes_of_frame(picture_shape, label_shape)
        # Zeroed pages cost nothing until they are written.
        self.pictures = np.zeros((capacity, *picture_shape), np.uint8)
        self.labels = np.zeros((capacity, entries), np.int8)
        self.weight = np.zeros((capacity, entries), np.float32)
        self.counts = np.zeros((2, entries), np.int64)

    @property
    def class_counts(self) -> NDArray[np.int64]:
        """(T, S, 2) a copy of `counts` in the shape of labels."""
        return self.counts.T.reshape(*self._label_shape, 2).copy()

    def put(self, slot: int, picture: NDArray[np.uint8], labels: NDArray[np.int8], weight: NDArray[np.float32]) -> None:
        """A frame, (H, W, C) with (T, S) labels and weights, into a slot that is empty."""
        self.pictures[slot] = picture
        self.labels[slot], self.weight[slot] = labels.ravel(), weight.ravel()
        self._tally(slot, 1)

    def drop(self, slot: int) -> None:
        """Empty a slot."""
        self._tally(slot, -1)

    def replace(self, slots: NDArray[np.int64], labels: NDArray[np.int8], weight: NDArray[np.float32]) -> None:
        """New labels and weights, (M, T, S) each, for the frames in slots (M,), in order; -1: passed over."""
        rows = (len(slots), self.labels.shape[1])
        new_labels = np.ascontiguousarray(labels, np.int8).reshape(rows)
        new_weight = np.ascontiguousarray(weight, np.float32).reshape(rows)
        kernels = KERNELS.get()
        (class_counts.replace if kernels is None else kernels.replace)(
            slots, new_labels, new_weight, self.labels, self.weight, self.counts
        )

    def batch(self, slots: NDArray[np.int64]) -> Batch:
        """The frames in slots (N,); it is good until one of them changes."""
        shape = (-1, *self._label_shape)
        return Batch(self.pictures, self.labels.reshape(shape), self.weight.reshape(shape), slots)

    def shards(self, slots: NDArray[np.int64]) -> Iterator[dict[str, NDArray[Any]]]:
        """The frames in these slots, in order, some thousands at a time: pictures, labels, weight."""
        frames = max(_SHARD_BYTES // self.frame_bytes, 1)
        for start in range(0, len(slots), frames):
            part = self.batch(slots[start : start + frames])
            yield {"pictures": part.pictures, "labels": part.labels, "weight": part.weight}

    def fill(self, shards: Iterable[Mapping[str, NDArray[Any]]], count: int) -> None:
        """Hold what `shards` gave, in the first `count` slots, and nothing else; ValueError if it does not fit."""
        self.counts[:] = 0
        filled = 0
        for shard in shards:
            for name, shape in (("pictures", self.pictures.shape[1:]), ("labels", self._label_shape)):
                if shard[name].shape[1:] != shape:
                    raise ValueError(f"replay buffer: saved {name} are {shard[name].shape[1:]}, expected {shape}")
            for frame in zip(shard["pictures"], shard["labels"], shard["weight"], strict=True):
                self.put(filled, *frame)
                filled += 1
        if filled != count:
            raise ValueError(f"replay buffer: expected {count} saved frames, found {filled}")

    def _tally(self, slot: int, sign: int) -> None:
        kernels = KERNELS.get()
        (class_counts.tally if kernels is None else kernels.tally)(self.labels[slot], sign, self.counts)


def bytes_of_frame(picture_shape: tuple[int, int, int], label_shape: tuple[int, int]) -> int:
    """What a frame of these shapes takes, with its labels and weights."""
    return int(np.prod(picture_shape)) + int(np.prod(label_shape)) * (1 + 4)
