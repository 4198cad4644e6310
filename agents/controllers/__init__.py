"""Controllers: plain objects that say where to drive, given what the robot knows now. No clock, no thread, no wire.

The agent that runs one, a simulated rollout and a test all call the same method with sensor time.
"""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Controller(Protocol):
    """The contract."""

    def command(
        self,
        t_ns: int,
        odometry_pose: Floats,
        bits: NDArray[np.int8] | None,
        prediction: NDArray[np.float32] | None,
    ) -> tuple[float, float]:
        """Decide on one command; called once for each odometry message, in order of time.

        Args:
            t_ns: sensor time of the pose.
            odometry_pose: (3,) float64 [x_m, y_m, yaw_rad].
            bits: (S,) int8 of the short-range sensors, left to right, -1 where unknown; None if there is no recent
                reading.
            prediction: (T, S) float32 probabilities, one row a target; None if there is no recent one.

        Returns:
            Forward speed [m/s] and turning rate, counter-clockwise [rad/s].
        """
        ...
