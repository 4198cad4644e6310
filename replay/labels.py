"""The label rule: which reading labels which target of which frame.

For a frame and a reading in its window, the reading's pose is expressed in the frame's pose. For each target the
candidates are the readings whose heading differs from the target's by at most the tolerance; the nearest in position
wins, ties by the smaller time between, then the earlier; its bits are the labels if it lies within the position
tolerance. (Nava et al. 2019, section III, "self-supervised label generation".)

`Matcher` answers for many pairs of frame and reading at once. A spatial hash of the targets finds the few targets near
each reading, so its cost does not grow with the number of targets.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from replay.poses import Floats, wrap
from replay.rule import LabelRule
from replay.targets import Targets
from replay.track import Moments
from replay.uncertainty import axes, relative_covariance, within_angle, within_disc

UNKNOWN = -1
_MOST_CELLS_AN_AXIS = 1024


@dataclass(frozen=True, eq=False)
class Matches:
    """Targets that readings lie within tolerance of; M matches, at most one a pair and target.

    Attributes:
        pair: (M,) which of the pairs asked about.
        target: (M,) which target.
        distance: (M,) from reading to target [m].
        weight: (M,) float32 probability that the reading truly lay within tolerance; 1 with a fixed window.
    """

    pair: NDArray[np.int64]
    target: NDArray[np.int64]
    distance: Floats
    weight: NDArray[np.float32]


class Matcher:
    """The rule's geometry for one set of targets.

    >>> matcher = Matcher(Targets.line(0.0, 0.3, 0.1), LabelRule(position_tolerance_m=0.06))
    >>> moments = lambda x: Moments(np.array([[x, 0.0, 0.0]]), np.zeros(1, np.int64), np.zeros((1, 9)))
    >>> found = matcher.match(moments(1.0), moments(1.15))
    >>> found.target, found.distance.round(3)
    (array([1, 2]), array([0.05, 0.05]))
    """

    def __init__(self, targets: Targets, rule: LabelRule) -> None:
        self._poses = targets.poses
        self._rule = rule
        low, high = self._poses[:, :2].min(0), self._poses[:, :2].max(0)
        self._cell = np.maximum(rule.position_tolerance_m, (high - low) / _MOST_CELLS_AN_AXIS)
        self._corner = low - 1.5 * self._cell
        self._cells = ((high - self._corner) / self._cell).astype(np.int64) + 2
        self._near = self._hash()

    def _hash(self) -> NDArray[np.int32]:
        """(cells, K) targets that a point in each cell may be within tolerance of, padded with -1."""
        home = ((self._poses[:, :2] - self._corner) / self._cell).astype(np.int64)
        around = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1], indexing="ij"), -1).reshape(-1, 2)
        cells = (home[:, None, :] + around[None, :, :]).reshape(-1, 2)
        keys = cells[:, 0] * self._cells[1] + cells[:, 1]
        owners = np.repeat(np.arange(len(home)), len(around))
        order = np.argsort(keys, kind="stable")
        keys, owners = keys[order], owners[order]
        rank = np.arange(len(keys)) - np.searchsorted(keys, keys, "left")
        near = np.full((int(self._cells.prod()), int(rank.max()) + 1), -1, np.int32)
        near[keys, rank] = owners
        return near

    def match(self, frames: Moments, readings: Moments) -> Matches:
        """The targets of `frames` that `readings` label; the two hold N moments each, pair by pair, or 1 against N."""
        frame, reading = frames.pose, readings.pose
        dx, dy = reading[:, 0] - frame[:, 0], reading[:, 1] - frame[:, 1]
        cos, sin = np.cos(frame[:, 2]), np.sin(frame[:, 2])
        x, y = cos * dx + sin * dy, cos * dy - sin * dx
        turned = reading[:, 2] - frame[:, 2]
        joined = np.broadcast_to((frames.trajectory == readings.trajectory) & (frames.trajectory >= 0), x.shape)

        cx, cy = (x - self._corner[0]) / self._cell[0], (y - self._corner[1]) / self._cell[1]
        inside = joined & (cx >= 0) & (cy >= 0) & (cx < self._cells[0]) & (cy < self._cells[1])
        pair = np.flatnonzero(inside)
        near = self._near[cx[pair].astype(np.int64) * self._cells[1] + cy[pair].astype(np.int64)]
        row, column = np.nonzero(near >= 0)
        pair, target = pair[row], near[row, column].astype(np.int64)

        off_x, off_y = x[pair] - self._poses[target, 0], y[pair] - self._poses[target, 1]
        distance = np.hypot(off_x, off_y)
        off_yaw = wrap(turned[pair] - self._poses[target, 2])
        keep = distance <= self._rule.position_tolerance_m
        if self._rule.heading_tolerance_rad is not None:
            keep &= np.abs(off_yaw) <= self._rule.heading_tolerance_rad
        found = np.flatnonzero(keep)
        pair, target, distance = pair[found], target[found], distance[found]
        if self._rule.window == "fixed":
            return Matches(pair, target, distance, np.ones(len(pair), np.float32))
        offset = np.stack([off_x[found], off_y[found]], -1)
        known, weight = self._certainty(frames, readings, pair, offset, off_yaw[found])
        return Matches(pair[known], target[known], distance[known], weight[known])

    def _certainty(
        self, frames: Moments, readings: Moments, pair: NDArray[np.int64], offset: Floats, off_yaw: Floats
    ) -> tuple[NDArray[np.bool_], NDArray[np.float32]]:
        """Is each pair's relative pose known to the gate, and how probably was the reading within tolerance?"""
        frame, reading = (side[pair] for side in np.broadcast_arrays(frames.pose, readings.pose))
        origin_sums, sums = (side[pair] for side in np.broadcast_arrays(frames.sums, readings.sums))
        covariance, heading_variance = relative_covariance(origin_sums, sums, reading[:, :2])
        cos, sin = np.cos(frame[:, 2]), np.sin(frame[:, 2])
        world = np.stack([cos * offset[:, 0] - sin * offset[:, 1], sin * offset[:, 0] + cos * offset[:, 1]], -1)
        weight = within_disc(world, covariance, self._rule.position_tolerance_m)
        if self._rule.heading_tolerance_rad is not None:
            # Heading and position errors of a pair are correlated; taking them as independent errs by little and low.
            weight = weight * within_angle(off_yaw, heading_variance, self._rule.heading_tolerance_rad)
        return axes(covariance)[0] <= self._rule.gate_m, weight.astype(np.float32)


def nearest_first(
    slot: NDArray[np.int64], distance: Floats, apart_ns: NDArray[np.int64], t_ns: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Indices of the winner of each slot: the nearest, ties by the smaller time apart, then the earlier reading."""
    order = np.lexsort((t_ns, apart_ns, distance, slot))
    first = np.ones(len(order), np.bool_)
    first[1:] = slot[order][1:] != slot[order][:-1]
    return order[first]
