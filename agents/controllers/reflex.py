"""The proximity reflex: drive, and turn away when a sensor feels something. A yardstick for driving on predictions."""

import numpy as np
from numpy.typing import NDArray

from llrp_online.configuration.running import Control

Floats = NDArray[np.float64]


class Reflex:
    """Straight on until a sensor feels something, then turn away from it until none does.

    >>> Reflex(Control()).command(0, np.zeros(3), np.array([1, 0, 0], np.int8), None)
    (0.0, -1.5)
    """

    def __init__(self, control: Control) -> None:
        self._control = control
        self._turning = 0.0

    def command(
        self,
        t_ns: int,  # noqa: ARG002 it lives in the moment
        odometry_pose: Floats,  # noqa: ARG002
        bits: NDArray[np.int8] | None,
        prediction: NDArray[np.float32] | None,  # noqa: ARG002
    ) -> tuple[float, float]:
        """Forward speed [m/s] and turning rate [rad/s]; see `agents.controllers.Controller`."""
        if bits is None:
            return 0.0, 0.0
        felt = bits == 1
        if not felt.any():
            self._turning = 0.0
            return self._control.speed_m_s, 0.0
        if not self._turning:
            half = len(felt) // 2
            self._turning = self._control.turn_rad_s * (-1.0 if felt[:half].sum() >= felt[-half:].sum() else 1.0)
        return 0.0, self._turning
