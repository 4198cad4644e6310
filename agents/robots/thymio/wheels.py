"""Wheels: from the firmware's sums to a pose with covariance, and from a command to the firmware's targets."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agents.robots.thymio.firmware import BEAT_S, LARGEST_TARGET, Report
from llrp_online.configuration import Thymio
from llrp_online.odometry import WheelOdometry

Floats = NDArray[np.float64]

_WRAP = 1 << 16
#: Over more beats than this a fast wheel's sum may have gone round: nobody can tell how far it rolled.
LONGEST_GAP_BEATS = (_WRAP // 2 - 1) // LARGEST_TARGET


@dataclass(frozen=True, eq=False)
class Moved:
    """Where a report puts the robot.

    Attributes:
        pose: (3,) float64 [x_m, y_m, yaw_rad], since the start.
        covariance: (3, 3) float64 of it, accumulated.
        speed_m_s: forward, over the time since the report before.
        turn_rad_s: counter-clockwise.
    """

    pose: Floats
    covariance: Floats
    speed_m_s: float
    turn_rad_s: float


def difference(after: int, before: int) -> int:
    """What a 16-bit sum grew by, if by less than half its range.

    >>> difference(65530, 4), difference(4, 65530)
    (-10, 10)
    """
    return (after - before + _WRAP // 2) % _WRAP - _WRAP // 2


class Wheels:
    """Odometry of one Thymio.

    Attributes:
        metres: rolled so far, forwards and backwards.

    >>> wheels = Wheels(Thymio(speed_unit_m_s=0.0004, track_m=0.1))
    >>> wheels.add(Report(5, 1000, 1000, 0, ())) is None
    True
    >>> wheels.add(Report(15, 3500, 3500, 0, ())).pose.round(6).tolist()  # ten beats at 250
    [0.01, 0.0, 0.0]
    """

    def __init__(self, calibration: Thymio) -> None:
        self._units_m_s = (
            calibration.speed_unit_m_s * calibration.left_scale,
            calibration.speed_unit_m_s * calibration.right_scale,
        )
        self._track_m = calibration.track_m
        self._odometry = WheelOdometry(calibration.track_m, calibration.wheel_noise_m_per_sqrt_m)
        self._before: Report | None = None
        self.metres = 0.0

    def restart(self) -> None:
        """The next report is the first of a robot that may have been moved; its pose is where it was last."""
        self._before = None

    def add(self, report: Report) -> Moved | None:
        """The pose at a report; None at the first one, and where the way since the last one cannot be known."""
        before, self._before = self._before, report
        if before is None:
            return None
        beats = (report.beats - before.beats) % _WRAP
        if not 0 < beats <= LONGEST_GAP_BEATS:
            return None
        seconds = beats * BEAT_S
        # Means of the firmware's speeds over the beats between, in m/s.
        left_m_s = difference(report.left, before.left) / beats * self._units_m_s[0]
        right_m_s = difference(report.right, before.right) / beats * self._units_m_s[1]
        pose, covariance = self._odometry.step(seconds, left_m_s, right_m_s)
        speed_m_s = (left_m_s + right_m_s) / 2
        self.metres += abs(speed_m_s) * seconds
        return Moved(pose, covariance, speed_m_s, (right_m_s - left_m_s) / self._track_m)

    def targets(self, speed_m_s: float, turn_rad_s: float) -> tuple[int, int]:
        """Left and right target of a command; what is too fast is slowed down, its curvature kept.

        >>> Wheels(Thymio(speed_unit_m_s=0.0004, track_m=0.1)).targets(0.1, 1.0)
        (125, 375)
        """
        half_m_s = turn_rad_s * self._track_m / 2
        left, right = (speed_m_s - half_m_s) / self._units_m_s[0], (speed_m_s + half_m_s) / self._units_m_s[1]
        excess = max(1.0, abs(left) / LARGEST_TARGET, abs(right) / LARGEST_TARGET)
        return round(left / excess), round(right / excess)
