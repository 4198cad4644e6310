"""Poses in the plane, SE(2), vectorised.

A pose is `[x_m, y_m, yaw_rad]`: x forward, y left, yaw counter-clockwise. Every function takes arrays whose last axis
is a pose, broadcasts over the others and returns float64. The paper's `p(t)` (Nava et al. 2019, section III).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


def wrap(angle_rad: ArrayLike) -> Floats:
    """The same angle in [-pi, pi).

    >>> float(wrap(3 * np.pi / 2))
    -1.5707963267948966
    """
    return (np.asarray(angle_rad, np.float64) + np.pi) % (2 * np.pi) - np.pi


def relative(origin: ArrayLike, pose: ArrayLike) -> Floats:
    """`pose` as seen from `origin`: origin^-1 * pose. Shapes (..., 3) and (..., 3) -> (..., 3).

    >>> relative([1.0, 0.0, np.pi / 2], [1.0, 2.0, np.pi / 2]).round(6)
    array([2., 0., 0.])
    """
    origin, pose = np.asarray(origin, np.float64), np.asarray(pose, np.float64)
    dx, dy = pose[..., 0] - origin[..., 0], pose[..., 1] - origin[..., 1]
    cos, sin = np.cos(origin[..., 2]), np.sin(origin[..., 2])
    return np.stack([cos * dx + sin * dy, cos * dy - sin * dx, wrap(pose[..., 2] - origin[..., 2])], -1)


def compose(origin: ArrayLike, step: ArrayLike) -> Floats:
    """The pose reached by `step`, given in the frame of `origin`. Shapes (..., 3) and (..., 3) -> (..., 3).

    >>> compose([1.0, 0.0, np.pi / 2], [2.0, 0.0, 0.0]).round(6)
    array([1.      , 2.      , 1.570796])
    """
    origin, step = np.asarray(origin, np.float64), np.asarray(step, np.float64)
    cos, sin = np.cos(origin[..., 2]), np.sin(origin[..., 2])
    x = origin[..., 0] + cos * step[..., 0] - sin * step[..., 1]
    y = origin[..., 1] + sin * step[..., 0] + cos * step[..., 1]
    return np.stack([x, y, wrap(origin[..., 2] + step[..., 2])], -1)


def interpolate(start: ArrayLike, stop: ArrayLike, fraction: ArrayLike) -> Floats:
    """The pose `fraction` of the way from `start` to `stop`: position linearly, yaw along the shorter arc.

    Shapes (..., 3), (..., 3) and (...) -> (..., 3).

    >>> interpolate([0.0, 0.0, 3.0], [1.0, 0.0, -3.0], 0.5).round(6)
    array([ 0.5     ,  0.      , -3.141593])
    """
    start, stop = np.asarray(start, np.float64), np.asarray(stop, np.float64)
    fraction = np.asarray(fraction, np.float64)[..., None]
    step = stop - start
    step[..., 2] = wrap(step[..., 2])
    pose = start + fraction * step
    pose[..., 2] = wrap(pose[..., 2])
    return pose
