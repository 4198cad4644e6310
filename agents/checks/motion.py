"""Odometry: units, jumps and axes, judged by what a robot can do."""

import cmath
import math

from agents.checks.finding import Finding, Histogram
from llrp_online.configuration.rig import Odometry
from llrp_online.events import OdometrySample
from replay.poses import wrap

_MOVING_M_S = 1e-3
_MOVED_M = 0.1
_TURNING_RAD_S = 0.05
_UNITS_FACTOR = 5.0  # so far beyond the configured speed at the median is no jump
_SPINNING_RAD_S = 12.0
_ALIGNED = 0.7  # of 1: how steadily it drives in one direction of its own
_SIDEWAYS_RAD, _BACKWARDS_RAD = math.radians(60), math.radians(150)


class Motion:
    """The poses, running.

    >>> import numpy as np
    >>> motion = Motion(Odometry())
    >>> for step in range(20):
    ...     motion.add(OdometrySample(step * 10**8, np.array([step * 200.0, 0.0, 0.0])))
    >>> motion.findings()[0].cause
    'positions in millimetres where metres are expected'
    """

    def __init__(self, limits: Odometry) -> None:
        self._limits = limits
        self._count = self._without_covariance = self._jumps = 0
        self._way_m = self._largest_jump_m = self._aligned_m = 0.0
        self._speeds, self._turns = Histogram(), Histogram()
        # Sums of unit vectors, weighted by metres: the direction of motion seen from the robot, and the same with its
        # yaw the other way round.
        self._direction = self._mirrored = 0j
        self._last: OdometrySample | None = None

    def add(self, sample: OdometrySample) -> None:
        """Take a pose."""
        self._count += 1
        self._without_covariance += sample.covariance is None
        last, self._last = self._last, sample
        seconds = (sample.t_ns - last.t_ns) / 1e9 if last is not None else 0.0
        if last is None or not 0 < seconds <= self._limits.max_gap_s:
            return
        x, y = (float(v) for v in sample.pose[:2] - last.pose[:2])
        way_m, turn = math.hypot(x, y), float(wrap(sample.pose[2] - last.pose[2]))
        self._way_m += way_m
        if way_m / seconds > _MOVING_M_S:
            self._speeds.add(way_m / seconds)
        if abs(turn) / seconds > _TURNING_RAD_S:
            self._turns.add(abs(turn) / seconds)
        if way_m / seconds > self._limits.max_speed_m_s:
            self._jumps += 1
            self._largest_jump_m = max(self._largest_jump_m, way_m)
        elif way_m / seconds > _MOVING_M_S:
            heading, direction = float(last.pose[2]) + turn / 2, math.atan2(y, x)
            self._aligned_m += way_m
            self._direction += way_m * cmath.exp(1j * (direction - heading))
            self._mirrored += way_m * cmath.exp(1j * (direction + heading))

    def findings(self) -> list[Finding]:
        """What is wrong with the poses."""
        found = [*self._units(), *self._axes()]
        if self._count and self._way_m < _MOVED_M:
            seen = f"it moved {self._way_m:.3f} m in all"
            mend = "drive further; labels come from passing where a picture has looked"
            found.append(
                Finding("warning", self._limits.topic, seen, "a parked robot, or wheels without encoders", mend)
            )
        if self._count and self._without_covariance == self._count:
            seen = "no covariance is given: the drift window takes the configuration's noise"
            found.append(Finding("note", self._limits.topic, seen))
        return found

    def _units(self) -> list[Finding]:
        found: list[Finding] = []
        topic, limit = self._limits.topic, self._limits.max_speed_m_s
        usual, fast_turn = self._speeds.quantile(0.5), self._turns.quantile(0.9)
        if usual > _UNITS_FACTOR * limit:
            # A hundredth of it would still be too fast, or it might be either.
            unit, factor = ("millimetres", "1000")
            if usual / 100 <= limit:
                unit, factor = ("centimetres (or millimetres, if it is slow)", "100 (or 1000)")
            found.append(
                Finding(
                    "error",
                    topic,
                    f"its usual speed is {usual:.1f} m/s, where at most {limit:g} m/s is configured",
                    f"positions in {unit} where metres are expected",
                    f"divide positions by {factor} in the driver",
                )
            )
        elif self._jumps:
            found.append(
                Finding(
                    "warning",
                    topic,
                    f"{self._jumps} pose jump{'s' * (self._jumps > 1)} faster than {limit:g} m/s, "
                    f"the largest {self._largest_jump_m:.2f} m; each ends the trajectory",
                    "localisation that corrects itself, a robot that was picked up, or a limit set too low",
                    "use plain odometry rather than localisation; or raise odometry.max_speed_m_s",
                )
            )
        if fast_turn > _SPINNING_RAD_S:
            found.append(
                Finding(
                    "error",
                    topic,
                    f"it turns at up to {fast_turn:.0f} rad/s",
                    "degrees where radians are expected, when the quaternion was made from yaw",
                    "convert yaw to radians before making the quaternion",
                )
            )
        return found

    def _axes(self) -> list[Finding]:
        if self._aligned_m < _MOVED_M:
            return []
        steady, mirrored = abs(self._direction) / self._aligned_m, abs(self._mirrored) / self._aligned_m
        angle = cmath.phase(self._direction)
        if steady < _ALIGNED < mirrored:
            return [
                Finding(
                    "error",
                    self._limits.topic,
                    "it drives straight only if its yaw is read the other way round",
                    "yaw counted clockwise, or y to the right, where counter-clockwise and left are expected",
                    "negate yaw or y in the driver (REP 103)",
                )
            ]
        if steady < _ALIGNED or abs(angle) < _SIDEWAYS_RAD:
            return []
        backwards = abs(angle) > _BACKWARDS_RAD
        return [
            Finding(
                "warning",
                self._limits.topic,
                f"it drives in the direction {math.degrees(angle):.0f} degrees from its x axis",
                "a robot that drives backwards, or x pointing back"
                if backwards
                else "axes turned by a quarter, or a robot that moves sideways",
                "let x point where the camera looks (REP 103)",
            )
        ]
