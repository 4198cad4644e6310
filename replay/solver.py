"""The label rule at work on the store's rings: what the reference and the compiled kernels both do.

Both read and write the same columns, hold nothing of their own, and give the same labels to the bit and the same
weights to 1e-6; either may take over between two messages.
"""

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from replay.columns import Frames, Readings
from replay.places import Places
from replay.ring import Ring
from replay.rule import LabelRule, OdometryLimits
from replay.targets import Targets
from replay.track import Settled, Track
from replay.uncertainty import SUMS, StepNoise


class Store(NamedTuple):
    """The rings, and the rule's constants."""

    track: Track
    readings: Ring[Readings]
    frames: Ring[Frames]
    places: Places

    @staticmethod
    def empty(
        targets: Targets,
        streams: Sequence[Sequence[int]],
        rule: LabelRule,
        limits: OdometryLimits,
        noise: StepNoise | None,
    ) -> "Store":
        """For T targets and, for each stream of readings, the sensors it speaks for, out of S."""
        drift = rule.window == "drift"
        if drift and noise is None:
            raise ValueError('rule.window = "drift" needs the noise of odometry steps, got noise=None')
        sums, sensors = SUMS if drift else 0, 1 + max(max(stream) for stream in streams)
        return Store(
            Track(limits, noise if drift else None),
            Ring(Readings.empty(sums, max(map(len, streams)))),
            Ring(Frames.empty(sums, len(streams), len(targets), sensors)),
            Places.of(targets, streams, rule),
        )


class Collected(NamedTuple):
    """Rows to hand out; see `replay.updates.Updates`. `first`: (M,) bool, a label of it is known for the first time."""

    frame_ids: NDArray[np.int64]
    t_ns: NDArray[np.int64]
    labels: NDArray[np.int8]
    weight: NDArray[np.float32]
    closed: NDArray[np.bool_]
    posed: NDArray[np.bool_]
    first: NDArray[np.bool_]

    @staticmethod
    def room(rows: int, shape: tuple[int, ...]) -> "Collected":
        """Arrays for so many rows of labels (T, S)."""
        return Collected(
            np.empty(rows, np.int64),
            np.empty(rows, np.int64),
            np.empty((rows, *shape), np.int8),
            np.empty((rows, *shape), np.float32),
            np.empty(rows, np.bool_),
            np.empty(rows, np.bool_),
            np.empty(rows, np.bool_),
        )

    def first_rows(self, count: int) -> "Collected":
        """The first of them."""
        return Collected(
            self.frame_ids[:count],
            self.t_ns[:count],
            self.labels[:count],
            self.weight[:count],
            self.closed[:count],
            self.posed[:count],
            self.first[:count],
        )


class Solver(Protocol):
    """Keeps the frames' labels what the rule says, given all that is in the rings."""

    def take_reading(self, row: int) -> bool:
        """A reading came in at this row: place it, and hold it against the frames waiting. Did a label change?"""
        ...

    def take_frames(self, first: int, last: int) -> bool:
        """Frames came in at rows `first` to `last - 1`: place them, label them by the readings kept. Has one a pose?"""
        ...

    def take_odometry(self, settled: Settled) -> bool:
        """A sample came in: place anew what it settles, and label anew what hangs on that. Did a label change?"""
        ...

    def collect(self, closing: int, *, only_closed: bool) -> Collected:
        """Copy out the frames before row `closing`, which close, and, unless `only_closed`, all others that changed.

        A frame that has no known label and never had one is left out, unless it closes.
        """
        ...
