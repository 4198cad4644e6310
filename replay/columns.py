"""What the trajectory store keeps of each odometry sample, reading and frame: the columns of its rings.

Plain arrays, one row a sample, reading or frame. The reference and the compiled kernels of the label rule both work on
them in place, and between two messages either may take over from the other.

Where the robot was is kept as `x_m`, `y_m`, `yaw_rad` (N,) float64, and `trajectory` (N,) int64: equal where two
moments may be joined; -1 where there is no pose, and the others mean nothing. `sums` (N, K) float64 is the odometry's
noise so far, see `replay.uncertainty`; K is 0 where nobody asks for it.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from replay.poses import Floats

Integers = NDArray[np.int64]
_ROOM = 64  # rows to begin with


class Samples(NamedTuple):
    """Odometry.

    Attributes:
        covariance: (N, 3, 3) of the pose, accumulated, where `given` (N,) bool.
    """

    t_ns: Integers
    x_m: Floats
    y_m: Floats
    yaw_rad: Floats
    trajectory: Integers
    sums: Floats
    covariance: Floats
    given: NDArray[np.bool_]

    @staticmethod
    def empty(sums: int) -> "Samples":
        """Room for some, with so many sums."""
        t_ns, x_m, y_m, yaw_rad, trajectory = _moments()
        noise = np.zeros((_ROOM, sums)), np.zeros((_ROOM, 3, 3))
        return Samples(t_ns, x_m, y_m, yaw_rad, trajectory, *noise, np.zeros(_ROOM, np.bool_))


class Readings(NamedTuple):
    """Short range.

    Attributes:
        stream: (N,) which stream of sensors spoke.
        bits: (N, sensors of the widest stream) int8: what they said, in the stream's order.
    """

    t_ns: Integers
    x_m: Floats
    y_m: Floats
    yaw_rad: Floats
    trajectory: Integers
    sums: Floats
    stream: Integers
    bits: NDArray[np.int8]

    @staticmethod
    def empty(sums: int, sensors: int) -> "Readings":
        """Room for some, of streams of at most so many sensors."""
        bits = np.zeros((_ROOM, sensors), np.int8)
        return Readings(*_moments(), np.zeros((_ROOM, sums)), np.zeros(_ROOM, np.int64), bits)


class Frames(NamedTuple):
    """Pictures that wait for their labels.

    Attributes:
        cos, sin: (N,) of the yaw: each pose is asked for them again and again.
        frame_id: (N,).
        best: (N, streams, T) float64 distance of the reading that labels each target now [m]; inf: none does.
        best_t_ns: (N, streams, T) that reading's time.
        labels: (N, T, S) int8: 1, 0, -1 unknown.
        weight: (N, T, S) float32 in [0, 1], 0 where unknown; T is 0 where it is 1 for all that is known.
        changed: (N,) bool: there is something to hand out.
        told: (N,) bool: some label of it was handed out before.
    """

    t_ns: Integers
    x_m: Floats
    y_m: Floats
    yaw_rad: Floats
    trajectory: Integers
    sums: Floats
    cos: Floats
    sin: Floats
    frame_id: Integers
    best: Floats
    best_t_ns: Integers
    labels: NDArray[np.int8]
    weight: NDArray[np.float32]
    changed: NDArray[np.bool_]
    told: NDArray[np.bool_]

    @staticmethod
    def empty(sums: int, streams: int, targets: int, sensors: int) -> "Frames":
        """Room for some."""
        slots = (_ROOM, streams, targets)
        return Frames(
            *_moments(),
            np.zeros((_ROOM, sums)),
            np.zeros(_ROOM),
            np.zeros(_ROOM),
            np.zeros(_ROOM, np.int64),
            np.zeros(slots),
            np.zeros(slots, np.int64),
            np.zeros((_ROOM, targets, sensors), np.int8),
            np.zeros((_ROOM, targets if sums else 0, sensors), np.float32),
            np.zeros(_ROOM, np.bool_),
            np.zeros(_ROOM, np.bool_),
        )


def _moments() -> tuple[Integers, Floats, Floats, Floats, Integers]:
    x_m, y_m, yaw_rad = np.zeros((3, _ROOM))
    return np.zeros(_ROOM, np.int64), x_m.copy(), y_m.copy(), yaw_rad.copy(), np.zeros(_ROOM, np.int64)
