"""What the learner takes in: one small frozen value for each kind of sensor message, with the sensor's own time."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class OdometrySample:
    """Where the robot believes it is.

    Attributes:
        t_ns: the sensor's time.
        pose: (3,) float64 `[x_m, y_m, yaw_rad]`.
        covariance: (3, 3) float64 of that pose, accumulated since the start; None where the robot gives none.
    """

    t_ns: int
    pose: NDArray[np.float64]
    covariance: NDArray[np.float64] | None = None


@dataclass(frozen=True, eq=False)
class Reading:
    """What the short-range sensors of one message said.

    Attributes:
        t_ns: the sensor's time.
        topic: which of the configuration's `range_topics` it came in.
        bits: (S,) int8 over all sensors of the rig: 1, 0, or -1 where this message says nothing.
    """

    t_ns: int
    topic: str
    bits: NDArray[np.int8]


@dataclass(frozen=True, eq=False)
class Picture:
    """What one camera saw, already at the network's size.

    Attributes:
        t_ns: the sensor's time.
        camera: index into the configuration's cameras.
        pixels: (height, width, 3) uint8, RGB.
    """

    t_ns: int
    camera: int
    pixels: NDArray[np.uint8]


Event = OdometrySample | Reading | Picture
