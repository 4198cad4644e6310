"""How much a single step may be off for a robot that gives poses without covariance.

The label rule's drift window adds such steps up.
"""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class MotionNoise:
    """How far a step of bare odometry may be off, growing with the way and the turn.

    Attributes:
        heading_noise_rad_per_sqrt_rad: deviation of the heading after a turn of one radian.
        heading_noise_rad_per_sqrt_m: deviation of the heading after one metre.
        position_noise_m_per_sqrt_m: deviation of the position after one metre, the same in every direction.

    >>> MotionNoise(0.03, 0.04, 0.02)(1.0, 0.0, 0.0)
    (0.0016, 0.0004, 0.0, 0.0004)
    """

    heading_noise_rad_per_sqrt_rad: float
    heading_noise_rad_per_sqrt_m: float
    position_noise_m_per_sqrt_m: float

    def __call__(self, x_m: float, y_m: float, turn_rad: float) -> tuple[float, float, float, float]:
        """The noise of a step, given in the frame of its start.

        Returns:
            Variance of the heading gained [rad^2], and covariance of the position as xx, xy, yy in the same frame
            [m^2], without what the heading's own error adds later.
        """
        way_m = math.hypot(x_m, y_m)
        heading = self.heading_noise_rad_per_sqrt_rad**2 * abs(turn_rad) + self.heading_noise_rad_per_sqrt_m**2 * way_m
        position = self.position_noise_m_per_sqrt_m**2 * way_m
        return heading, position, 0.0, position
