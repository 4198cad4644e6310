"""The body: two driven wheels under a disc. What they were told, what they did, and what their encoders make of it.

Kinematic: no forces; wheels change their speed at a limited rate and roll one exact arc a tick. They slip, and
their radii are not quite the nominal ones; the odometry integrates what the encoders counted with the nominal radii, so
it drifts from the true pose as a real one does.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from agents.robots.simulated.layout import Footprints
from llrp_online.configuration.running import Simulation
from replay.poses import wrap

Floats = NDArray[np.float64]

SLIP_LENGTH_M = 0.01  # `slip` is given after this much of a wheel's way
TOUCH_M = 0.002  # a contact ends when the body is this far from everything
ROUNDING_M = 1e-9  # a pose found free stays free when its clearance is computed once more
HALVINGS = 12  # of a tick's way, to find where it ends at an obstacle: to a few micrometres


class Body:
    """A differential drive that walls and obstacles stop.

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
        self._wheels_m_s: Floats = np.zeros(2)  # left and right
        self._radius_m = simulation.radius_m
        self._centre_ahead_m = simulation.centre_ahead_m
        self._slip = simulation.slip
        self._footprints = footprints
        self._rng = rng
        self._rolling = 1.0 + simulation.bias * rng.standard_normal(2)  # true over nominal radius, left and right
        self._in_contact = False
        self.true_pose: Floats = np.array(start, np.float64)
        self.odometry: Floats = np.zeros(3)
        self.covariance: Floats = np.zeros((3, 3))
        self.twist: Floats = np.zeros(2)
        self.blocked = False
        self.collisions = 0
        if not self._is_free(self.true_pose):
            raise ValueError(f"start {self.true_pose.round(3).tolist()}: the body would stand inside an obstacle")

    def step(self, speed_m_s: float, turn_rad_s: float, duration_s: float) -> None:
        """Drive for one tick; a command beyond the wheels' limit is slowed down, its curvature kept."""
        self._drive_wheels(speed_m_s, turn_rad_s, duration_s)
        wheels = self._wheels_m_s * duration_s  # each one's way, by its encoder
        # Independent increments whose variance grows with the way: after SLIP_LENGTH_M the deviation is `slip` of it.
        slip_m = self._slip * np.sqrt(SLIP_LENGTH_M * np.abs(wheels)) * self._rng.standard_normal(2)
        rolled = wheels * self._rolling + slip_m

        share = self._free_share(rolled)
        self.true_pose = self._arc(self.true_pose, share * rolled)
        # A blocked Thymio's wheels stall rather than spin: the encoders count only the way that was free.
        self._wheels_m_s *= share
        self._propagate(share * wheels)
        self.odometry = self._arc(self.odometry, share * wheels)
        left, right = self._wheels_m_s
        self.twist = np.array([(left + right) / 2, (right - left) / self._track_m])
        self._note_contact(share < 1.0)

    def _drive_wheels(self, speed_m_s: float, turn_rad_s: float, duration_s: float) -> None:
        """Bring the wheels' speeds towards the command, both by the same share of what is missing."""
        if not np.isfinite([speed_m_s, turn_rad_s]).all():
            raise ValueError(f"command: expected finite speeds, got {speed_m_s} m/s and {turn_rad_s} rad/s")
        half = turn_rad_s * self._track_m / 2
        wanted = np.array([speed_m_s - half, speed_m_s + half])
        wanted /= max(1.0, np.abs(wanted).max() / self._limit_m_s)
        missing = wanted - self._wheels_m_s
        possible = self._acceleration_m_s2 * duration_s
        self._wheels_m_s = self._wheels_m_s + missing / max(1.0, np.abs(missing).max() / possible)

    def _arc(self, pose: Floats, wheels: Floats) -> Floats:
        """The pose after both wheels rolled their ways at constant speeds."""
        way, turn = wheels.mean(), (wheels[1] - wheels[0]) / self._track_m
        chord = way * np.sinc(turn / 2 / np.pi)  # 2 r sin(turn / 2), and simply `way` when straight
        heading = pose[2] + turn / 2
        x, y = pose[0] + chord * np.cos(heading), pose[1] + chord * np.sin(heading)
        return np.array([x, y, wrap(pose[2] + turn)])

    def _propagate(self, wheels: Floats) -> None:
        """P <- F P F' + G Q G', with the Jacobians of `_arc` by pose (F) and wheels (G); chord taken as way."""
        way, turn = wheels.mean(), (wheels[1] - wheels[0]) / self._track_m
        heading = self.odometry[2] + turn / 2
        cos, sin = np.cos(heading), np.sin(heading)
        by_pose = np.array([[1.0, 0.0, -way * sin], [0.0, 1.0, way * cos], [0.0, 0.0, 1.0]])
        by_way_and_turn = np.array([[cos, -way / 2 * sin], [sin, way / 2 * cos], [0.0, 1.0]])
        by_wheels = by_way_and_turn @ np.array([[0.5, 0.5], [-1 / self._track_m, 1 / self._track_m]])
        slip = np.diag(self._slip**2 * SLIP_LENGTH_M * np.abs(wheels))
        self.covariance = by_pose @ self.covariance @ by_pose.T + by_wheels @ slip @ by_wheels.T

    def _clearance_m(self, pose: Floats) -> float:
        centre = pose[:2] + self._centre_ahead_m * np.array([np.cos(pose[2]), np.sin(pose[2])])
        return self._footprints.clearance_m(centre) - self._radius_m

    def _is_free(self, pose: Floats) -> bool:
        return self._clearance_m(pose) >= -ROUNDING_M

    def _free_share(self, rolled: Floats) -> float:
        """How much of the way is free, from 0 to 1. A tick's way is far shorter than any obstacle's and the body's."""
        if self._is_free(self._arc(self.true_pose, rolled)):
            return 1.0
        free, blocked = 0.0, 1.0
        for _ in range(HALVINGS):
            middle = (free + blocked) / 2
            if self._is_free(self._arc(self.true_pose, middle * rolled)):
                free = middle
            else:
                blocked = middle
        return free

    def _note_contact(self, blocked: bool) -> None:
        self.blocked = blocked
        if blocked and not self._in_contact:
            self.collisions += 1
        self._in_contact = blocked or (self._in_contact and self._clearance_m(self.true_pose) < TOUCH_M)
