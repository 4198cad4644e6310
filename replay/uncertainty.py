"""How well odometry knows the pose of one moment relative to another, and what that makes of a label.

With heading noise of variance q_s and position noise Q_s in the step s, the relative position covariance from a to b is
`sum q_s (p_b - p_s)^perp (p_b - p_s)^perp^T + sum Q_s` over the steps between, in the world's axes: a heading error at
p_s turns all that lies beyond it. The sums of q, q p, q p p^T and Q up to each odometry sample give every pair in O(1);
it holds forward and backward in time.
"""

import math
from typing import Protocol

import numpy as np

from replay.poses import Floats

#: Length of a row of sums: q, q x, q y, q xx, q xy, q yy, Q xx, Q xy, Q yy.
SUMS = 9
#: Gauss-Legendre, for the integral over a disc.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)
#: So many deviations to either side hold all but 6e-7 of a normal distribution.
REACH = 5.0
#: No deviation is taken to be smaller [m, rad].
LEAST = 1e-9


class StepNoise(Protocol):
    """The noise of an odometry step where the robot itself gives no covariance."""

    def __call__(self, x_m: float, y_m: float, turn_rad: float, /) -> tuple[float, float, float, float]:
        """A step in its start's frame -> heading variance [rad^2], position covariance xx, xy, yy there [m^2]."""
        ...


def step_sums(
    start: list[float], stop: list[float], noise: StepNoise, before: Floats | None, after: Floats | None
) -> tuple[float, ...]:
    """What one odometry step adds to the sums: 9 numbers.

    Args:
        start: `[x_m, y_m, yaw_rad]` before the step.
        stop: the pose after it.
        noise: the noise where no covariance is given, or where it stands still while the robot moves.
        before: (3, 3) accumulated covariance before the step, or None.
        after: (3, 3) accumulated covariance after it, or None.
    """
    way_x, way_y = stop[0] - start[0], stop[1] - start[1]
    if before is None or after is None or np.array_equal(before, after):
        cos, sin = math.cos(start[2]), math.sin(start[2])
        turn = (stop[2] - start[2] + math.pi) % math.tau - math.pi
        q, xx, xy, yy = noise(cos * way_x + sin * way_y, cos * way_y - sin * way_x, turn)
        n_xx = cos * cos * xx - 2 * cos * sin * xy + sin * sin * yy
        n_yy = sin * sin * xx + 2 * cos * sin * xy + cos * cos * yy
        n_xy = cos * sin * (xx - yy) + (cos * cos - sin * sin) * xy
    else:
        q, n_xx, n_xy, n_yy = _growth(way_x, way_y, before, after)
    x, y = (start[0] + stop[0]) / 2, (start[1] + stop[1]) / 2
    return q, q * x, q * y, q * x * x, q * x * y, q * y * y, n_xx, n_xy, n_yy


def _growth(way_x: float, way_y: float, before: Floats, after: Floats) -> tuple[float, float, float, float]:
    """The step's own noise: what the accumulated covariance gained beyond carrying the old one along."""
    carry = np.array([[1.0, 0.0, -way_y], [0.0, 1.0, way_x], [0.0, 0.0, 1.0]])
    gained = after - carry @ before @ carry.T
    xx, yy, xy = float(gained[0, 0]), float(gained[1, 1]), float(gained[0, 1] + gained[1, 0]) / 2
    # What rounding or a filter's update made smaller is no noise: leave out axes along which the variance fell.
    mean, half = (xx + yy) / 2, math.hypot((xx - yy) / 2, xy)
    if mean + half <= 0:
        xx = xy = yy = 0.0
    elif mean - half < 0:
        share = (mean + half) / (2 * half)
        xx, xy, yy = share * (xx - mean + half), share * xy, share * (yy - mean + half)
    return max(float(gained[2, 2]), 0.0), xx, xy, yy


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
    mean, lean = (xx + yy) / 2, (xx - yy) / 2
    half = np.sqrt(lean * lean + xy * xy)
    long, short = np.sqrt(np.maximum(mean + half, 0.0)), np.sqrt(np.maximum(mean - half, 0.0))
    return long, short, 0.5 * np.arctan2(2 * xy, xx - yy)


def within_disc(offset: Floats, covariance: Floats, radius: float) -> Floats:
    """Probability that a point lies within `radius` of the origin: (N,).

    Args:
        offset: (N, 2) its mean.
        covariance: (N, 3) its covariance as xx, xy, yy, in the same axes.
        radius: of the disc.

    The integral along the longer axis is closed. The one along the shorter is taken with 16 Gauss-Legendre nodes over
    the part of the disc within `REACH` deviations, in the angle at which the disc's edge is seen there: so the chord, a
    cosine, is smooth to its end.
    """
    long, short, angle = axes(covariance)
    long, short = np.maximum(long, LEAST)[:, None], np.maximum(short, LEAST)[:, None]
    cos, sin = np.cos(angle), np.sin(angle)
    u = (cos * offset[:, 0] + sin * offset[:, 1])[:, None]
    v = (cos * offset[:, 1] - sin * offset[:, 0])[:, None]
    low, high = (np.arcsin(np.clip((v + side * REACH * short) / radius, -1.0, 1.0)) for side in (-1, 1))
    edge = (low + high) / 2 + (high - low) / 2 * NODES
    across, chord = radius * np.sin(edge), radius * np.cos(edge)
    density = np.exp(-0.5 * ((across - v) / short) ** 2) / (short * np.sqrt(2 * np.pi))
    inner = _share_below((chord - u) / long) - _share_below((-chord - u) / long)
    return np.clip((high - low)[:, 0] / 2 * ((density * chord * inner) @ WEIGHTS), 0.0, 1.0)


def within_angle(offset_rad: Floats, variance: Floats, tolerance_rad: float) -> Floats:
    """Probability that a heading lies within `tolerance_rad` of zero: (N,), for mean (N,) and variance (N,)."""
    deviation = np.maximum(np.sqrt(variance), LEAST)
    above, below = (tolerance_rad - offset_rad) / deviation, (-tolerance_rad - offset_rad) / deviation
    return _share_below(above) - _share_below(below)


def _share_below(deviations: Floats) -> Floats:
    """Of a normal distribution."""
    # Compiled code does without: a command does not wait at its start for what only this form needs.
    from scipy.special import ndtr

    return ndtr(deviations)
