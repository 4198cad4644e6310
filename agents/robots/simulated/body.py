"""The body: two driven wheels under a disc. What they were told, what they did, and what their encoders make of it.

Kinematic: no forces; wheels change their speed at a limited rate and roll one exact arc a tick. They slip, and
their radii are not quite the nominal ones; the odometry integrates what the encoders counted with the nominal radii, so
it drifts from the true pose as a real one does.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from agents.robots.simulated.layout import Footprints
from llrp_online.configuration.running import Simulation
from replay.poses import wrap

Floats = NDArray[np.float64]
Pair = tuple[float, float]  # left and right, or x and y; plain, as an array of two costs more than its arithmetic

SLIP_LENGTH_M = 0.01  # `slip` is given after this much of a wheel's way
TOUCH_M = 0.002  # a contact ends when the body is this far from everything
ROUNDING_M = 1e-9  # a pose found free stays free when its clearance is computed once more
HALVINGS = 12  # of a tick's way, to find where it ends at an obstacle: to a few micrometres


class Body:
    """A differential drive that walls, obstacles and legs stop.

    Attributes, after each `step`:
        true_pose: (3,) float64 [x_m, y_m, yaw_rad], in the arena.
        odometry: (3,) float64, since the start, in a frame that begins at the start.
        covariance: (3, 3) float64 of `odometry`, accumulated, from wheel slip alone: encoders know of no bias.
        twist: (2,) float64 [m/s, rad/s], as the encoders saw it.
        blocked: something stopped this step.
        collisions: how often a contact began.

    >>> ideal = Simulation(slip=0.0, bias=0.0, wheel_acceleration_m_s2=100.0)
    >>> body = Body(ideal, Footprints([]), [1.0, 0.0, np.pi / 2], np.random.default_rng(0))
    >>> body.step(0.1, 0.0, 0.5)
    >>> body.odometry.round(3).tolist(), body.true_pose.round(3).tolist()
    ([0.05, 0.0, 0.0], [1.0, 0.05, 1.571])
    """

    def __init__(
        self, simulation: Simulation, footprints: Footprints, start: ArrayLike, rng: np.random.Generator
    ) -> None:
        self._track_m = simulation.track_m
        self._limit_m_s = simulation.wheel_limit_m_s
        self._acceleration_m_s2 = simulation.wheel_acceleration_m_s2
        self._wheels_m_s: Pair = (0.0, 0.0)
        self._radius_m = simulation.radius_m
        self._centre_ahead_m = simulation.centre_ahead_m
        self._slip = simulation.slip
        self._footprints = footprints
        self._rng = rng
        left, right = rng.standard_normal(2).tolist()
        self._rolling: Pair = (1.0 + simulation.bias * left, 1.0 + simulation.bias * right)  # true over nominal radius
        self._in_contact = False
        self.true_pose: Floats = np.array(start, np.float64)
        self.odometry: Floats = np.zeros(3)
        self.covariance: Floats = np.zeros((3, 3))
        self.twist: Floats = np.zeros(2)
        self.blocked = False
        self.collisions = 0
        self._clear_m = self._clearance_m(self.true_pose)  # at least so far to the nearest outline
        if self._clear_m < -ROUNDING_M:
            raise ValueError(f"start {self.true_pose.round(3).tolist()}: the body would stand inside an obstacle")

    def step(self, speed_m_s: float, turn_rad_s: float, duration_s: float) -> None:
        """Drive for one tick; a command beyond the wheels' limit is slowed down, its curvature kept."""
        self._drive_wheels(speed_m_s, turn_rad_s, duration_s)
        left, right = _times(duration_s, self._wheels_m_s)  # each one's way, by its encoder
        # Independent increments whose variance grows with the way: after SLIP_LENGTH_M the deviation is `slip` of it.
        noise_left, noise_right = self._rng.standard_normal(2).tolist()
        rolled = (
            left * self._rolling[0] + self._slip * math.sqrt(SLIP_LENGTH_M * abs(left)) * noise_left,
            right * self._rolling[1] + self._slip * math.sqrt(SLIP_LENGTH_M * abs(right)) * noise_right,
        )

        share = self._free_share(rolled)
        self.true_pose = self._arc(self.true_pose, _times(share, rolled))
        # A blocked Thymio's wheels stall rather than spin: the encoders count only the way that was free.
        self._wheels_m_s = _times(share, self._wheels_m_s)
        counted = _times(share, (left, right))
        self._propagate(counted)
        self.odometry = self._arc(self.odometry, counted)
        left, right = self._wheels_m_s
        self.twist = np.array([(left + right) / 2, (right - left) / self._track_m])
        self._note_contact(share < 1.0)

    def _drive_wheels(self, speed_m_s: float, turn_rad_s: float, duration_s: float) -> None:
        """Bring the wheels' speeds towards the command, both by the same share of what is missing."""
        if not (math.isfinite(speed_m_s) and math.isfinite(turn_rad_s)):
            raise ValueError(f"command: expected finite speeds, got {speed_m_s} m/s and {turn_rad_s} rad/s")
        half = turn_rad_s * self._track_m / 2
        left, right = speed_m_s - half, speed_m_s + half
        excess = max(1.0, abs(left) / self._limit_m_s, abs(right) / self._limit_m_s)
        missing = left / excess - self._wheels_m_s[0], right / excess - self._wheels_m_s[1]
        possible = self._acceleration_m_s2 * duration_s
        ticks = max(1.0, abs(missing[0]) / possible, abs(missing[1]) / possible)
        self._wheels_m_s = self._wheels_m_s[0] + missing[0] / ticks, self._wheels_m_s[1] + missing[1] / ticks

    def _arc(self, pose: Floats, wheels: Pair) -> Floats:
        """The pose after both wheels rolled their ways at constant speeds."""
        x, y, yaw = pose.tolist()
        way, turn = self._way_and_turn(wheels)
        chord = way * (math.sin(turn / 2) / (turn / 2) if turn else 1.0)  # 2 r sin(turn / 2)
        heading = yaw + turn / 2
        return np.array([x + chord * math.cos(heading), y + chord * math.sin(heading), wrap(yaw + turn)])

    def _way_and_turn(self, wheels: Pair) -> Pair:
        left, right = wheels
        return (left + right) / 2, (right - left) / self._track_m

    def _propagate(self, wheels: Pair) -> None:
        """P <- F P F' + G Q G', with the Jacobians of `_arc` by pose (F) and wheels (G); chord taken as way."""
        way, turn = self._way_and_turn(wheels)
        heading = float(self.odometry[2]) + turn / 2
        cos, sin = math.cos(heading), math.sin(heading)
        by_pose = np.array([[1.0, 0.0, -way * sin], [0.0, 1.0, way * cos], [0.0, 0.0, 1.0]])
        across = way / 2 / self._track_m  # half the way, by what a wheel's way turns
        by_wheels = np.array(
            [
                [cos / 2 + across * sin, cos / 2 - across * sin],
                [sin / 2 - across * cos, sin / 2 + across * cos],
                [-1 / self._track_m, 1 / self._track_m],
            ]
        )
        slip = self._slip**2 * SLIP_LENGTH_M
        variances = np.array([slip * abs(wheels[0]), slip * abs(wheels[1])])
        self.covariance = by_pose @ self.covariance @ by_pose.T + by_wheels * variances @ by_wheels.T

    @property
    def disc(self) -> tuple[float, float, float]:
        """Where the body is, seen from above: its middle's x and y, and its radius [m]."""
        return *self._middle_m(self.true_pose), self._radius_m

    def _middle_m(self, pose: Floats) -> Pair:
        x, y, yaw = pose.tolist()
        return x + self._centre_ahead_m * math.cos(yaw), y + self._centre_ahead_m * math.sin(yaw)

    def _clearance_m(self, pose: Floats) -> float:
        return self._footprints.clearance_m(self._middle_m(pose)) - self._radius_m

    def _is_free(self, pose: Floats) -> bool:
        return self._clearance_m(pose) >= -ROUNDING_M

    def _free_share(self, rolled: Pair) -> float:
        """How much of the way is free, from 0 to 1. A tick's way is far shorter than any obstacle's and the body's."""
        # The clearance shrinks by no more than the disc's centre moves: where it was large, nobody has to look again.
        way, turn = self._way_and_turn(rolled)
        self._clear_m -= abs(way) + abs(turn) * self._centre_ahead_m
        if self._clear_m > 0 and not self._footprints.moving:
            return 1.0
        self._clear_m = self._clearance_m(self._arc(self.true_pose, rolled))
        if self._clear_m >= -ROUNDING_M:
            return 1.0
        self._clear_m = 0.0
        free, blocked = 0.0, 1.0
        for _ in range(HALVINGS):
            middle = (free + blocked) / 2
            if self._is_free(self._arc(self.true_pose, _times(middle, rolled))):
                free = middle
            else:
                blocked = middle
        return free

    def _note_contact(self, blocked: bool) -> None:
        self.blocked = blocked
        if blocked and not self._in_contact:
            self.collisions += 1
        self._in_contact = blocked or (self._in_contact and self._clearance_m(self.true_pose) < TOUCH_M)


def _times(factor: float, pair: Pair) -> Pair:
    return factor * pair[0], factor * pair[1]
