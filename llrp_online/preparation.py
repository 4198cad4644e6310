"""From a batch as it was drawn to what the network takes: gathered, augmented and standardised, in one call."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from llrp_online.augment import Augmenter, grains, ramp
from llrp_online.network import standardise
from replay.batch import Batch
from replay.compiling import Compiled


class Prepared(NamedTuple):
    """What the network and the loss take.

    Attributes:
        pictures: (N, H, W, C) float32 in C order, standardised as `network.standardise` does it.
        labels: (N, T, S) int8.
        weight: (N, T, S) float32.
    """

    pictures: NDArray[np.float32]
    labels: NDArray[np.int8]
    weight: NDArray[np.float32]


class Tables(NamedTuple):
    """What is the same for all pictures of one shape.

    Attributes:
        grains: float32, the table of normals.
        across: (W * C,) float32, how much of a shadow from side to side falls on each value of a line.
        along: (H,) float32, how much of one from top to bottom falls on each line.
        mirrored: (W * C,) uint32, which value of a line a mirrored one has in each place.
        entries: (T * S,) int64, the same for labels.
    """

    grains: NDArray[np.float32]
    across: NDArray[np.float32]
    along: NDArray[np.float32]
    mirrored: NDArray[np.uint32]
    entries: NDArray[np.int64]


class Preparation:
    """Augments and standardises batches: compiled in one pass over the rows where they lie, or step by step.

    Both draw the same random numbers, and differ by rounding alone.

    Args:
        augment: what is to be done at random.

    >>> from llrp_online.configuration.learning import Augmentation
    >>> prepare = Preparation(Augmenter(Augmentation(flip=0, colour=0), None))
    >>> batch = Batch(np.zeros((2, 8, 8, 3), np.uint8), np.zeros((2, 1, 1), np.int8), np.ones((2, 1, 1), np.float32))
    >>> prepare(batch, np.random.default_rng(0)).pictures.mean((1, 2, 3)).round(3) + 0
    array([0., 0.], dtype=float32)
    """

    def __init__(self, augment: Augmenter) -> None:
        self._augment = augment
        self._compiled = Compiled("llrp_online.preparation_kernels")
        self._tables: tuple[tuple[int, ...], Tables] | None = None  # with the shapes they are for

    def __call__(self, batch: Batch, rng: np.random.Generator) -> Prepared:
        """All randomness comes from `rng`; the batch stays as it is."""
        kernels = self._compiled.get()
        prepared = self._step_by_step(batch, rng) if kernels is None else self._at_once(kernels, batch, rng)
        self._augment.turn_colours(prepared.pictures, rng)
        return prepared

    def _step_by_step(self, batch: Batch, rng: np.random.Generator) -> Prepared:
        augmented = self._augment(batch.pictures, batch.labels, batch.weight, rng)
        return Prepared(standardise(augmented.pictures).permute(0, 2, 3, 1).numpy(), augmented.labels, augmented.weight)

    def _at_once(self, kernels: Any, batch: Batch, rng: np.random.Generator) -> Prepared:
        (_, *picture), (_, *label) = batch.frames.pictures.shape, batch.frames.labels.shape
        values, entries = int(np.prod(picture)), int(np.prod(label))
        if self._tables is None or self._tables[0] != (*picture, *label):
            self._tables = (*picture, *label), self._tables_for(picture, label)
        count = len(batch)
        prepared = Prepared(
            np.empty((count, *picture), np.float32),
            np.empty((count, *label), np.int8),
            np.empty((count, *label), np.float32),
        )
        kernels.prepare(
            batch.frames.pictures,
            batch.frames.labels.reshape(len(batch.frames.labels), entries),
            batch.frames.weight.reshape(len(batch.frames.weight), entries),
            batch.rows,
            *self._augment.draw(count, values, rng),
            *self._tables[1],
            prepared.pictures,
            prepared.labels.reshape(count, entries),
            prepared.weight.reshape(count, entries),
        )
        return prepared

    def _tables_for(self, picture: list[int], label: list[int]) -> Tables:
        height, width, channels = picture
        columns = np.arange(width * channels, dtype=np.uint32).reshape(width, channels)
        entries = np.arange(int(np.prod(label))).reshape(label)
        if (mirror := self._augment.mirror) is not None:
            columns = columns[::-1, mirror.channels]
            entries = entries[mirror.targets[:, None], mirror.sensors]
        across = np.repeat(ramp(width), channels)
        return Tables(grains(height * width * channels), across, ramp(height), columns.ravel(), entries.ravel())
