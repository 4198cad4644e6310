"""The odometry track: where the robot was at any moment, which trajectory that belongs to, and how the noise added up.

A gap longer than `max_gap_s` or a jump faster than `max_speed_m_s` between two samples ends the trajectory; between
such samples there is no pose.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.poses import Floats, interpolate
from replay.ring import Ring
from replay.rule import OdometryLimits
from replay.uncertainty import SUMS, StepNoise, step_sums


@dataclass(frozen=True, eq=False)
class Moments:
    """The robot at N moments.

    Attributes:
        pose: (N, 3) float64; meaningless where `trajectory` is -1.
        trajectory: (N,) int64, equal where two moments may be joined; -1: no pose.
        sums: (N, 9) float64 of the noise so far, see `replay.uncertainty`.
    """

    pose: Floats
    trajectory: NDArray[np.int64]
    sums: Floats


class Track:
    """Odometry samples, sorted by time whatever order they came in.

    >>> track = Track(OdometryLimits(max_gap_s=0.5, max_speed_m_s=3.0))
    >>> for t_s in (0.0, 0.2, 0.4, 2.0):
    ...     _ = track.add(round(t_s * 1e9), np.array([t_s, 0.0, 0.0]))
    >>> moments = track.at(np.array([100_000_000, 1_000_000_000, 2_000_000_000]))
    >>> moments.pose[0], moments.trajectory
    (array([0.1, 0. , 0. ]), array([ 0, -1,  1]))
    """

    def __init__(self, limits: OdometryLimits, noise: StepNoise | None = None) -> None:
        self._limits = limits
        self._noise = noise
        self._rows = Ring(
            {
                "pose": (np.float64, (3,)),
                "covariance": (np.float64, (3, 3)),
                "given": (np.bool_, ()),
                "trajectory": (np.int64, ()),
                "sums": (np.float64, (SUMS,)),
            }
        )

    def __len__(self) -> int:
        """How many samples are kept."""
        return len(self._rows)

    def newest_until(self, t_ns: int) -> int | None:
        """Time of the newest sample not after `t_ns`, or None."""
        at = int(np.searchsorted(self._rows["t_ns"], t_ns, "right"))
        return int(self._rows["t_ns"][at - 1]) if at else None

    def has(self, t_ns: int) -> bool:
        """Is there a sample of exactly this time?"""
        return self._rows.has(t_ns)

    def add(self, t_ns: int, pose: Floats, covariance: NDArray[np.float64] | None = None) -> tuple[int, int, bool]:
        """Take in a sample.

        Returns:
            The open interval of times whose pose this settles or changes (before, after), int64 limits where it has no
            end, and whether the trajectories or sums of other samples changed with it.
        """
        given = covariance is not None
        values = {"pose": pose, "covariance": covariance if given else 0.0, "given": given}
        at = self._rows.insert(t_ns, values)
        old = self._rows["trajectory"][at + 1 :].copy()
        for row in range(at, len(self._rows)):
            self._chain(row)
        times, limit = self._rows["t_ns"], np.iinfo(np.int64)
        before = int(times[at - 1]) if at else limit.min
        after = int(times[at + 1]) if at + 1 < len(times) else limit.max
        joined_alike = np.array_equal(old, self._rows["trajectory"][at + 1 :])
        late = at + 1 < len(times)
        return before, after, late and (not joined_alike or self._noise is not None)

    def at(self, t_ns: NDArray[np.int64]) -> Moments:
        """The robot at the times `t_ns` (N,): interpolated between the samples around each, exact on a sample."""
        times = self._rows["t_ns"]
        if not len(times):
            return Moments(np.zeros((len(t_ns), 3)), np.full(len(t_ns), -1), np.zeros((len(t_ns), SUMS)))
        after = np.minimum(np.searchsorted(times, t_ns, "left"), len(times) - 1)
        before = np.where(times[after] == t_ns, after, np.maximum(after - 1, 0))
        span = np.maximum(times[after] - times[before], 1)
        fraction = (t_ns - times[before]) / span
        trajectory = self._rows["trajectory"]
        inside = (t_ns >= times[0]) & (t_ns <= times[-1]) & (trajectory[before] == trajectory[after])
        sums = self._rows["sums"]
        return Moments(
            interpolate(self._rows["pose"][before], self._rows["pose"][after], fraction),
            np.where(inside, trajectory[after], -1),
            sums[before] + fraction[:, None] * (sums[after] - sums[before]),
        )

    def forget_before(self, t_ns: int) -> None:
        """Drop the samples that no time from `t_ns` on needs any more."""
        self._rows.drop(max(int(np.searchsorted(self._rows["t_ns"], t_ns, "right")) - 1, 0))

    def state(self) -> dict[str, NDArray[Any]]:
        """The samples, as arrays."""
        return self._rows.state()

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Hold the samples that `state` gave."""
        self._rows.restore(state)

    def clear(self) -> None:
        """Forget all samples."""
        self._rows.clear()

    def _chain(self, row: int) -> None:
        """Set a row's trajectory and sums from the row before it; the oldest row kept holds its own."""
        if row == 0:
            return
        rows = self._rows
        seconds = float(rows["t_ns"][row] - rows["t_ns"][row - 1]) * 1e-9
        start, stop = rows["pose"][row - 1], rows["pose"][row]
        metres = float(np.hypot(stop[0] - start[0], stop[1] - start[1]))
        broken = seconds > self._limits.max_gap_s or metres > self._limits.max_speed_m_s * seconds
        rows["trajectory"][row] = rows["trajectory"][row - 1] + broken
        if self._noise is not None:
            before, after = (np.asarray(rows["covariance"][i]) if rows["given"][i] else None for i in (row - 1, row))
            rows["sums"][row] = rows["sums"][row - 1] + step_sums(start, stop, self._noise, before, after)
