"""The robot seen from above: where it went, where its sensors fired, how well odometry knows where it was."""

import math
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from llrp_online.configuration import RobotConfiguration
from llrp_online.events import OdometrySample, Reading
from replay.poses import Floats, relative, wrap
from replay.track import Track
from replay.uncertainty import axes, relative_covariance

#: Points of the path that are drawn, each at least so far from the last.
_POINTS, _APART_M, _APART_RAD = 4000, 0.01, 0.2
_FIRED = 1500
#: Odometry is kept for so long at most: that much is gone over once a second.
_LONGEST_S = 180.0
#: Odometry further back than this is another clock.
_SET_BACK_NS = 5_000_000_000
#: Places and moments that are tried to see how near readings come to targets.
_TRIED = 12


class Point(NamedTuple):
    """Of the path; `joined`: a line leads here from the point before."""

    robot_s: float
    x_m: float
    y_m: float
    joined: bool


class Fired(NamedTuple):
    """A sensor was 1."""

    robot_s: float
    x_m: float
    y_m: float
    yaw_rad: float
    sensor: int


class Window(NamedTuple):
    """What the label window spans now.

    Attributes:
        back_s: how far back it reaches.
        reached_m: farthest that the robot got from where it was, within it.
        long_m, short_m, angle_rad: deviations of the pose now as seen from the window's far end, and where the longer
            axis points, in the world.
    """

    back_s: float
    reached_m: float
    long_m: float
    short_m: float
    angle_rad: float


class Misses(NamedTuple):
    """How near readings came to targets, of those that came nearest (a tenth of all).

    Attributes:
        distance_m: from the target; None where there is too little to tell.
        turned_rad: of the readings within the position tolerance, how far their heading was off; None likewise.
    """

    distance_m: float | None
    turned_rad: float | None


class Ground:
    """What odometry and short range say, for a while.

    Args:
        configuration: the robot's.

    Attributes:
        epoch: counts the clocks that odometry had: what is drawn of an earlier one is to be wiped off.
        points: how many points the path has had; `path` ends with the newest.
        fired_count: the same of `fired`.
    """

    def __init__(self, configuration: RobotConfiguration) -> None:
        self._labels, self._odometry = configuration.labels, configuration.odometry
        self._targets = configuration.targets.build().poses
        self.epoch = 0
        self._begin()

    def _begin(self) -> None:
        self._track = Track(self._odometry.limits(), self._odometry.noise())
        self._first_ns: int | None = None
        self.path: deque[Point] = deque(maxlen=_POINTS)
        self.fired: deque[Fired] = deque(maxlen=_FIRED)
        self.points = self.fired_count = 0
        self._readings_ns: deque[int] = deque(maxlen=_POINTS)
        self._last: tuple[float, float, float, int] | None = None

    @property
    def now_ns(self) -> int | None:
        """Time of the newest odometry."""
        return int(self._track.live.t_ns[-1]) if len(self._track) else None

    @property
    def pose(self) -> tuple[float, float, float] | None:
        """The newest."""
        if not len(self._track):
            return None
        rows = self._track.live
        return float(rows.x_m[-1]), float(rows.y_m[-1]), float(rows.yaw_rad[-1])

    def robot_s(self, t_ns: int) -> float:
        """Seconds after the first odometry."""
        return 0.0 if self._first_ns is None else (t_ns - self._first_ns) * 1e-9

    def moved_m(self, seconds: float) -> float:
        """The way driven lately."""
        rows = self._track.live
        if not len(rows.t_ns):
            return 0.0
        some = slice(int(rows.t_ns.searchsorted(rows.t_ns[-1] - round(seconds * 1e9))), None)
        return float(np.hypot(np.diff(rows.x_m[some]), np.diff(rows.y_m[some])).sum())

    def odometry(self, sample: OdometrySample) -> None:
        """Take in where the robot believes it is."""
        now_ns = self.now_ns
        if now_ns is not None and sample.t_ns < now_ns - _SET_BACK_NS:
            self.epoch += 1
            self._begin()
        if self._track.has(sample.t_ns):
            return
        self._first_ns = sample.t_ns if self._first_ns is None else self._first_ns
        self._track.add(
            sample.t_ns, sample.pose.tolist(), sample.covariance if self._odometry.trust_covariance else None
        )
        self._track.forget_before(sample.t_ns - round(_LONGEST_S * 1e9))
        self._draw(sample.t_ns)

    def reading(self, reading: Reading) -> None:
        """Take in what short range said, after the odometry of its time."""
        self._readings_ns.append(reading.t_ns)
        rows = self._track.live
        at = int(rows.t_ns.searchsorted(reading.t_ns, "right")) - 1
        if at < 0:
            return
        robot_s = self.robot_s(reading.t_ns)
        for sensor in np.flatnonzero(reading.bits == 1).tolist():
            self.fired.append(Fired(robot_s, float(rows.x_m[at]), float(rows.y_m[at]), float(rows.yaw_rad[at]), sensor))
            self.fired_count += 1

    def window(self) -> Window | None:
        """The window now in force, back from now; None without odometry."""
        rows = self._track.live
        if not len(rows.t_ns):
            return None
        here = slice(int(rows.t_ns.searchsorted(rows.t_ns[-1] - self._labels.rule().window_ns)), None)
        position = np.stack([rows.x_m[here], rows.y_m[here]], -1)
        sums, same = rows.sums[here], rows.trajectory[here] == rows.trajectory[-1]
        covariance, _ = relative_covariance(
            sums, np.broadcast_to(sums[-1], sums.shape), np.tile(position[-1], (len(sums), 1))
        )
        long_m, short_m, angle = axes(covariance)
        within = same
        if self._labels.window == "drift":
            within = same & (long_m <= self._labels.rule().gate_m)
        first = int(np.flatnonzero(within)[0])
        way_m = np.hypot(*(position[first:] - position[-1]).T)
        return Window(
            float(rows.t_ns[-1] - rows.t_ns[here][first]) * 1e-9,
            float(way_m.max()),
            float(long_m[first]),
            float(short_m[first]),
            float(angle[first]),
        )

    def misses(self) -> Misses:
        """How near readings came to the targets of a dozen moments."""
        rows, rule = self._track.live, self._labels.rule()
        times = np.array([t for t in self._readings_ns if len(rows.t_ns) and rows.t_ns[0] <= t <= rows.t_ns[-1]])
        if len(times) < 2:
            return Misses(None, None)
        poses = np.stack(
            [np.interp(times, rows.t_ns, column) for column in (rows.x_m, rows.y_m, np.unwrap(rows.yaw_rad))], -1
        )
        nearest: list[Floats] = []
        turned: list[NDArray[np.float64]] = []
        for moment in np.linspace(0, len(times) - 1, min(_TRIED, len(times))).astype(int):
            some = np.abs(times - times[moment]) <= rule.window_ns
            seen = relative(poses[moment], poses[some])[:, None, :]
            off_m = np.hypot(seen[..., 0] - self._targets[:, 0], seen[..., 1] - self._targets[:, 1])
            off_rad = np.abs(wrap(seen[..., 2] - self._targets[:, 2]))
            nearest.append(off_m.min(0))
            close = np.where(off_m <= rule.position_tolerance_m, off_rad, np.inf).min(0)
            turned.append(close[np.isfinite(close)])
        angles = np.concatenate(turned)
        return Misses(
            float(np.quantile(np.concatenate(nearest), 0.1)),
            float(np.quantile(angles, 0.1)) if len(angles) else None,
        )

    def _draw(self, t_ns: int) -> None:
        """A point of the path, if the robot has come far enough since the last."""
        rows = self._track.live
        x_m, y_m, yaw_rad = float(rows.x_m[-1]), float(rows.y_m[-1]), float(rows.yaw_rad[-1])
        trajectory = int(rows.trajectory[-1])
        joined = self._last is not None and self._last[3] == trajectory
        if self._last is not None and joined:
            turn = abs((yaw_rad - self._last[2] + math.pi) % math.tau - math.pi)
            if math.hypot(x_m - self._last[0], y_m - self._last[1]) < _APART_M and turn < _APART_RAD:
                return
        self._last = x_m, y_m, yaw_rad, trajectory
        self.path.append(Point(self.robot_s(t_ns), x_m, y_m, joined))
        self.points += 1
