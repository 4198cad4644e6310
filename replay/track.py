"""The odometry track: where the robot was at any moment, which trajectory that belongs to, and how the noise added up.

A gap longer than `max_gap_s` or a jump faster than `max_speed_m_s` between two samples ends the trajectory; between
such samples there is no pose.
"""

import math
from typing import NamedTuple

import numpy as np

from replay.columns import Samples
from replay.poses import Floats
from replay.ring import Ring
from replay.rule import OdometryLimits
from replay.uncertainty import SUMS, StepNoise, step_sums

_LIMIT = np.iinfo(np.int64)
EARLIEST_NS, LATEST_NS = int(_LIMIT.min), int(_LIMIT.max)


class Settled(NamedTuple):
    """What a sample of odometry settles or changes.

    Attributes:
        before_ns: the poses of the times after this...
        after_ns: ...and before this; the limits of int64 where there is no end.
        late: there were newer samples: some of these poses were another.
        rejoined: trajectories or sums of other samples changed with it.
    """

    before_ns: int
    after_ns: int
    late: bool
    rejoined: bool


class Track(Ring[Samples]):
    """Odometry samples, sorted by time whatever order they came in.

    >>> track = Track(OdometryLimits(max_gap_s=0.5, max_speed_m_s=3.0))
    >>> for t_s in (0.0, 0.2, 0.4, 2.0):
    ...     settled = track.add(round(t_s * 1e9), [t_s, 0.0, 0.0])
    >>> track.live.trajectory
    array([0, 0, 0, 1])
    >>> settled.before_ns, settled.late
    (400000000, False)
    """

    def __init__(self, limits: OdometryLimits, noise: StepNoise | None = None) -> None:
        super().__init__(Samples.empty(SUMS if noise else 0))
        self._limits = limits
        self._noise = noise

    def newest_until(self, t_ns: int) -> int | None:
        """Time of the newest sample not after `t_ns`, or None."""
        row = self.from_ns(t_ns + 1)
        return self.columns.t_ns.item(row - 1) if row > self.start else None

    def add(self, t_ns: int, pose: list[float], covariance: Floats | None = None) -> Settled:
        """Take in a sample: `[x_m, y_m, yaw_rad]` and, where the robot gives one, its accumulated covariance (3, 3)."""
        row = self.insert(t_ns)
        rows = self.columns
        rows.x_m[row], rows.y_m[row], rows.yaw_rad[row] = pose
        rows.given[row] = covariance is not None
        rows.covariance[row] = 0.0 if covariance is None else covariance
        first, last = row == self.start, row + 1 == self.stop
        before_ns = EARLIEST_NS if first else rows.t_ns.item(row - 1)
        if last:
            self._chain(row)
            return Settled(before_ns, LATEST_NS, late=False, rejoined=False)
        newer = slice(row + 1, self.stop)
        old = rows.trajectory[newer].copy()
        for later in range(row, self.stop):
            self._chain(later)
        rejoined = self._noise is not None or not np.array_equal(old, rows.trajectory[newer])
        return Settled(before_ns, rows.t_ns.item(row + 1), late=True, rejoined=rejoined)

    def forget_before(self, t_ns: int) -> None:
        """Drop the samples that no time from `t_ns` on needs any more."""
        self.drop_before(max(self.passed(t_ns + 1) - 1, self.start))

    def _chain(self, row: int) -> None:
        """Set a row's trajectory and sums from the row before it."""
        rows = self.columns
        if row == self.start:
            rows.trajectory[row], rows.sums[row] = 0, 0.0
            return
        seconds = (rows.t_ns.item(row) - rows.t_ns.item(row - 1)) * 1e-9
        start, stop = ([column.item(at) for column in (rows.x_m, rows.y_m, rows.yaw_rad)] for at in (row - 1, row))
        metres = math.hypot(stop[0] - start[0], stop[1] - start[1])
        broken = seconds > self._limits.max_gap_s or metres > self._limits.max_speed_m_s * seconds
        rows.trajectory[row] = rows.trajectory.item(row - 1) + broken
        if self._noise is not None:
            before, after = (rows.covariance[at] if rows.given.item(at) else None for at in (row - 1, row))
            rows.sums[row] = rows.sums[row - 1] + step_sums(start, stop, self._noise, before, after)
