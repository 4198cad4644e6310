"""Odometry where a robot has none of its own: wheels and gyro to a pose with covariance.

`WheelOdometry` is an extended Kalman filter on filterpy. Thrun, Burgard and Fox, Probabilistic Robotics (2005), section
5.4: a wheel's error is a random walk over the way it rolled.
"""

from typing import Any, cast

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter, update
from numpy.typing import NDArray

from replay.poses import compose

Floats = NDArray[np.float64]


class WheelOdometry:
    """Differential drive: an extended Kalman filter over `[x_m, y_m, yaw_rad]`, starting at the origin, certain.

    A gyro and the wheels both measure the turn of a step; they are weighed by their variances before the pose moves.
    Systematic errors (a wheel's true radius, the gyro's bias) are not modelled: allow for them in the noise.

    Args:
        track_m: distance between the wheels.
        wheel_noise_m_per_sqrt_m: deviation of a wheel's way after one metre.
        gyro_noise_rad_per_sqrt_s: deviation of the gyro's angle after one second.

    >>> odometry = WheelOdometry(track_m=0.1)
    >>> pose, covariance = odometry.step(0.05, left_m_s=0.1, right_m_s=0.1)
    >>> pose, bool(covariance[0, 0] > 0)
    (array([0.005, 0.   , 0.   ]), True)
    """

    def __init__(
        self,
        track_m: float,
        wheel_noise_m_per_sqrt_m: float = 0.005,
        gyro_noise_rad_per_sqrt_s: float = 0.002,
    ) -> None:
        if not track_m > 0:
            raise ValueError(f"track_m: expected more than 0, got {track_m}")
        self._track_m = track_m
        self._wheel_noise = wheel_noise_m_per_sqrt_m
        self._gyro_noise = gyro_noise_rad_per_sqrt_s
        self._filter = _PoseFilter()

    def step(
        self, dt_s: float, left_m_s: float, right_m_s: float, yaw_rate_rad_s: float | None = None
    ) -> tuple[Floats, Floats]:
        """Move on by `dt_s` at these wheel speeds; return the pose (3,) and its covariance (3, 3)."""
        if not dt_s > 0:
            raise ValueError(f"dt_s: expected more than 0, got {dt_s}")
        wheels_m = np.array([left_m_s, right_m_s]) * dt_s
        # [forward_m, turn_rad] from the way of the left and the right wheel
        mixing = np.array([[0.5, 0.5], [-1 / self._track_m, 1 / self._track_m]])
        motion = mixing @ wheels_m
        noise = mixing @ np.diag(self._wheel_noise**2 * np.abs(wheels_m)) @ mixing.T
        if yaw_rate_rad_s is not None:
            motion, noise = self._weigh(motion, noise, yaw_rate_rad_s * dt_s, self._gyro_noise**2 * dt_s)
        self._filter.move(motion, noise)
        return self._filter.x.copy(), self._filter.P.copy()

    @staticmethod
    def _weigh(motion: Floats, noise: Floats, turn_rad: float, variance: float) -> tuple[Floats, Floats]:
        """The motion, corrected by the gyro's turn (a Kalman update in Joseph's form)."""
        if noise[1, 1] + variance == 0:  # neither may be wrong, as when a robot stands and the gyro is said to be exact
            return motion, noise
        corrected = update(motion, noise, np.array([turn_rad]), np.array([[variance]]), np.array([[0.0, 1.0]]))
        return cast(tuple[Floats, Floats], corrected)


class _PoseFilter(ExtendedKalmanFilter):
    """The pose and its covariance, moved along an arc."""

    def __init__(self) -> None:
        super().__init__(dim_x=3, dim_z=1)
        self.x: Floats = np.zeros(3)
        self.P: Floats = np.zeros((3, 3))

    def move(self, motion: Floats, noise: Floats) -> None:
        """Go `motion` = [forward_m, turn_rad], known to the covariance `noise` (2, 2)."""
        forward_m, turn_rad = motion
        chord_m = forward_m * np.sinc(turn_rad / (2 * np.pi))  # sin(turn / 2) / (turn / 2) of the arc
        half_rad = turn_rad / 2
        cos, sin = np.cos(self.x[2] + half_rad), np.sin(self.x[2] + half_rad)
        self.F = np.array([[1, 0, -chord_m * sin], [0, 1, chord_m * cos], [0, 0, 1]])
        # How the pose moves with forward_m and turn_rad; that the chord shortens with the turn is of second order.
        by_motion = np.array([[cos, -chord_m / 2 * sin], [sin, chord_m / 2 * cos], [0, 1]])
        self.Q = by_motion @ noise @ by_motion.T
        step: Any = np.array([chord_m * np.cos(half_rad), chord_m * np.sin(half_rad), turn_rad])
        self.predict(step)
        self.P[:] = (self.P + self.P.T) / 2  # rounding alone must not make it lopsided

    def predict_x(self, u: Any = 0) -> None:
        """filterpy's hook for a motion that is not linear: `u` is the step in the robot's frame, (3,)."""
        self.x = compose(self.x, u)
