"""What the trajectory store hands out: what became known of many frames at once, or of each in turn."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class LabelUpdate(NamedTuple):
    """What has become known of one frame.

    Attributes:
        frame_id: as given to `add_frame`.
        t_ns: the frame's time.
        labels: (T, S) int8, all of the frame's labels so far: 1, 0, -1 unknown.
        weight: (T, S) float32 in [0, 1]; 0 where unknown.
        picture: the frame's picture, with the first update that has a known label; None in every other.
        closed: the window has passed; this is the frame's last update.
        posed: odometry told where the frame was taken.
    """

    frame_id: int
    t_ns: int
    labels: NDArray[np.int8]
    weight: NDArray[np.float32]
    picture: NDArray[np.uint8] | None
    closed: bool
    posed: bool


@dataclass(eq=False, slots=True)
class Updates:
    """What has become known of M frames, in order of their time; iterates over `LabelUpdate`s.

    Attributes:
        frame_ids: (M,) int64.
        t_ns: (M,) int64.
        labels: (M, T, S) int8.
        weight: (M, T, S) float32.
        closed: (M,) bool.
        posed: (M,) bool.
        pictures: by frame id, of the frames that have a known label for the first time.
    """

    frame_ids: NDArray[np.int64]
    t_ns: NDArray[np.int64]
    labels: NDArray[np.int8]
    weight: NDArray[np.float32]
    closed: NDArray[np.bool_]
    posed: NDArray[np.bool_]
    pictures: Mapping[int, NDArray[np.uint8]]

    def __len__(self) -> int:
        """How many frames."""
        return len(self.frame_ids)

    def __iter__(self) -> Iterator[LabelUpdate]:
        """Frame by frame."""
        scalars = (self.frame_ids.tolist(), self.t_ns.tolist(), self.closed.tolist(), self.posed.tolist())
        for row, (frame_id, t_ns, closed, posed) in enumerate(zip(*scalars, strict=True)):
            picture = self.pictures.get(frame_id)
            yield LabelUpdate(frame_id, t_ns, self.labels[row], self.weight[row], picture, closed, posed)

    @staticmethod
    def none(shape: tuple[int, int]) -> "Updates":
        """Of no frame, for labels (T, S)."""
        ids, flags = np.empty(0, np.int64), np.empty(0, np.bool_)
        return Updates(ids, ids, np.empty((0, *shape), np.int8), np.empty((0, *shape), np.float32), flags, flags, {})

    @staticmethod
    def lost(frame_id: int, t_ns: int, shape: tuple[int, int]) -> "Updates":
        """Of one frame that closes with nothing known, not even where it was taken."""
        labels, weight = np.full((1, *shape), -1, np.int8), np.zeros((1, *shape), np.float32)
        closed, posed = np.ones(1, np.bool_), np.zeros(1, np.bool_)
        return Updates(np.array([frame_id]), np.array([t_ns]), labels, weight, closed, posed, {})

    @staticmethod
    def joined(parts: Sequence["Updates"]) -> "Updates":
        """One after the other; at least one is wanted."""
        parts = [part for part in parts if len(part)] or parts[:1]
        if len(parts) == 1:
            return parts[0]
        return Updates(
            np.concatenate([part.frame_ids for part in parts]),
            np.concatenate([part.t_ns for part in parts]),
            np.concatenate([part.labels for part in parts]),
            np.concatenate([part.weight for part in parts]),
            np.concatenate([part.closed for part in parts]),
            np.concatenate([part.posed for part in parts]),
            {frame_id: picture for part in parts for frame_id, picture in part.pictures.items()},
        )
