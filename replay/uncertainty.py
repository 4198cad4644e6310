"""How well odometry knows the pose of one moment relative to another, and what that makes of a label.

With heading noise of variance q_s and position noise Q_s in the step s, the relative position covariance from a to b is
`sum q_s (p_b - p_s)^perp (p_b - p_s)^perp^T + sum Q_s` over the steps between, in the world's axes: a heading error at
p_s turns all that lies beyond it. The sums of q, q p, q p p^T and Q up to each odometry sample give every pair in O(1);
it holds forward and backward in time.
"""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from replay.poses import Floats, relative

#: Length of a row of sums: q, q x, q y, q xx, q xy, q yy, Q xx, Q xy, Q yy.
SUMS = 9
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)


class StepNoise(Protocol):
    """The noise of odometry steps where the robot itself gives no covariance."""

    def __call__(self, step: Floats, /) -> tuple[Floats, Floats]:
        """Steps (..., 3), each in its start's frame -> heading variance (...) [rad^2], position covariance (..., 2, 2)
        in the same frame [m^2].
        """
        ...


def step_sums(
    start: Floats, stop: Floats, noise: StepNoise, before: NDArray[np.float64] | None, after: NDArray[np.float64] | None
) -> Floats:
    """What one odometry step adds to the sums: (9,).

    Args:
        start: (3,) pose before the step.
        stop: (3,) pose after it.
        noise: the noise where no covariance is given, or where it stands still while the robot moves.
        before: (3, 3) accumulated covariance before the step, or None.
        after: (3, 3) accumulated covariance after it, or None.
    """
    if before is None or after is None or np.array_equal(before, after):
        variance, local = noise(relative(start, stop))
        cos, sin = np.cos(start[2]), np.sin(start[2])
        turn = np.array([[cos, -sin], [sin, cos]])
        position = turn @ local @ turn.T
    else:
        variance, position = _growth(start, stop, before, after)
    x, y = (start[:2] + stop[:2]) / 2
    q = float(variance)
    return np.array([q, q * x, q * y, q * x * x, q * x * y, q * y * y, position[0, 0], position[0, 1], position[1, 1]])


def _growth(start: Floats, stop: Floats, before: Floats, after: Floats) -> tuple[float, Floats]:
    """The step's own noise: what the accumulated covariance gained beyond carrying the old one along."""
    carry = np.eye(3)
    carry[0, 2], carry[1, 2] = start[1] - stop[1], stop[0] - start[0]
    gained = after - carry @ before @ carry.T
    values, vectors = np.linalg.eigh((gained[:2, :2] + gained[:2, :2].T) / 2)
    return max(float(gained[2, 2]), 0.0), (vectors * np.maximum(values, 0.0)) @ vectors.T


def relative_covariance(origin_sums: Floats, sums: Floats, position: Floats) -> tuple[Floats, Floats]:
    """Covariance of poses as seen from origins.

    Args:
        origin_sums: (N, 9) sums at the origins.
        sums: (N, 9) sums at the poses.
        position: (N, 2) of the poses, in the world.

    Returns:
        Position covariance (N, 3) as xx, xy, yy in the world's axes [m^2], and heading variance (N,) [rad^2].
    """
    later = np.where((sums[:, :1] >= origin_sums[:, :1]), 1.0, -1.0)
    q, qx, qy, qxx, qxy, qyy, n_xx, n_xy, n_yy = ((sums - origin_sums) * later).T
    x, y = position.T
    # Differences of long sums: rounding may leave a variance a hair below zero.
    xx = np.maximum(q * y * y - 2 * y * qy + qyy + n_xx, 0.0)
    yy = np.maximum(q * x * x - 2 * x * qx + qxx + n_yy, 0.0)
    xy = -(q * x * y - x * qy - y * qx + qxy) + n_xy
    return np.stack([xx, xy, yy], -1), np.maximum(q, 0.0)


def axes(covariance: Floats) -> tuple[Floats, Floats, Floats]:
    """Standard deviations along the axes of the ellipse, and where it points.

    Args:
        covariance: (N, 3) as xx, xy, yy.

    Returns:
        Longer deviation (N,), shorter deviation (N,), angle of the longer axis (N,) [rad].
    """
    xx, xy, yy = covariance.T
    mean, half = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    long, short = np.sqrt(np.maximum(mean + half, 0.0)), np.sqrt(np.maximum(mean - half, 0.0))
    return long, short, 0.5 * np.arctan2(2 * xy, xx - yy)


def within_disc(offset: Floats, covariance: Floats, radius: float) -> Floats:
    """Probability that a point lies within `radius` of the origin: (N,).

    Args:
        offset: (N, 2) its mean.
        covariance: (N, 3) its covariance as xx, xy, yy, in the same axes.
        radius: of the disc.

    The integral along the longer axis is closed; the one along the shorter is taken with 16 Gauss-Legendre nodes in the
    coordinate's own cumulative probability, so that a deviation near zero needs no finer grid.
    """
    long, short, angle = axes(covariance)
    long, short = np.maximum(long, 1e-9)[:, None], np.maximum(short, 1e-9)[:, None]
    cos, sin = np.cos(angle), np.sin(angle)
    u = (cos * offset[:, 0] + sin * offset[:, 1])[:, None]
    v = (cos * offset[:, 1] - sin * offset[:, 0])[:, None]
    low, high = ndtr((-radius - v) / short), ndtr((radius - v) / short)
    share = low + (high - low) * (_NODES + 1) / 2
    across = np.clip(v + short * ndtri(np.clip(share, 1e-300, 1 - 1e-16)), -radius, radius)
    chord = np.sqrt(np.maximum(radius**2 - across**2, 0.0))
    inner = ndtr((chord - u) / long) - ndtr((-chord - u) / long)
    return np.clip((high - low)[:, 0] / 2 * (inner @ _WEIGHTS), 0.0, 1.0)


def within_angle(offset_rad: Floats, variance: Floats, tolerance_rad: float) -> Floats:
    """Probability that a heading lies within `tolerance_rad` of zero: (N,), for mean (N,) and variance (N,)."""
    deviation = np.maximum(np.sqrt(variance), 1e-9)
    return ndtr((tolerance_rad - offset_rad) / deviation) - ndtr((-tolerance_rad - offset_rad) / deviation)
