"""Target poses: where, relative to the robot, the short-range sensors are to be predicted.

The paper's `p_1 ... p_n` (Nava et al. 2019, section III): 31 poses on a line for the
Thymio, a 17x17 grid for the Pioneer.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from replay.poses import Floats, wrap


@dataclass(frozen=True, eq=False)
class Targets:
    """Target poses in the robot's frame.

    `poses` is (T, 3) float64: x forward [m], y left [m], yaw counter-clockwise [rad].

    >>> Targets.line(0.0, 0.3, 0.01).poses.shape
    (31, 3)
    >>> Targets.grid([-3.0, 5.0, 0.5], [-4.0, 4.0, 0.5]).poses.shape
    (289, 3)
    """

    poses: Floats

    @classmethod
    def line(cls, start_m: float, stop_m: float, step_m: float) -> "Targets":
        """Poses along the robot's axis, both ends included."""
        x = _ticks(start_m, stop_m, step_m)
        return cls(np.stack([x, np.zeros_like(x), np.zeros_like(x)], -1))

    @classmethod
    def grid(cls, x_m: ArrayLike, y_m: ArrayLike) -> "Targets":
        """A grid, each axis as `[start, stop, step]` with both ends included; x is the outer axis, y the inner."""
        x, y = (_ticks(*np.asarray(axis, np.float64).tolist()) for axis in (x_m, y_m))
        gx, gy = np.meshgrid(x, y, indexing="ij")
        return cls(np.stack([gx.ravel(), gy.ravel(), np.zeros(gx.size)], -1))

    @classmethod
    def listed(cls, poses: ArrayLike) -> "Targets":
        """Poses given one by one as `[x_m, y_m, yaw_rad]`; ValueError unless the shape is (T, 3) with T >= 1."""
        array = np.array(poses, np.float64)
        if array.ndim != 2 or array.shape[1] != 3 or not len(array):
            raise ValueError(f"target poses: expected [[x_m, y_m, yaw_rad], ...], got an array of shape {array.shape}")
        return cls(array)

    def __len__(self) -> int:
        """How many targets."""
        return len(self.poses)

    def mirror(self) -> NDArray[np.int64] | None:
        """Where each target goes when left and right swap: (T,) indices, or None if some target has no mirror image.

        >>> Targets.grid([0.0, 0.5, 0.5], [-0.5, 0.5, 0.5]).mirror()
        array([2, 1, 0, 5, 4, 3])
        >>> Targets.listed([[0.0, 0.1, 0.0]]).mirror() is None
        True
        """
        mirrored = self.poses * [1.0, -1.0, -1.0]
        apart = mirrored[:, None, :] - self.poses[None, :, :]
        apart[..., 2] = wrap(apart[..., 2])
        error = np.abs(apart).max(-1)
        nearest = error.argmin(1)
        return nearest.astype(np.int64) if bool((error.min(1) < 1e-6).all()) else None


def _ticks(start: float, stop: float, step: float) -> Floats:
    """start, start + step, ... up to and including stop."""
    if not step > 0 or stop < start:
        raise ValueError(f"targets: expected start <= stop and step > 0, got start={start}, stop={stop}, step={step}")
    return start + step * np.arange(int(np.floor((stop - start) / step + 1e-6)) + 1, dtype=np.float64)
