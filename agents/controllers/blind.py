"""Random turning: straight on for a while, then a random turn, feeling and seeing nothing. What any sense must beat."""

import numpy as np
from numpy.typing import NDArray

from llrp_online.configuration.running import Control

Floats = NDArray[np.float64]

STRAIGHT_S = (1.0, 4.0)
TURN_S = (0.3, 1.5)


class Blind:
    """Drives and turns at random times.

    >>> Blind(Control(), seed=0).command(0, np.zeros(3), None, None)
    (0.12, 0.0)
    """

    def __init__(self, control: Control, seed: int) -> None:
        self._control = control
        self._random = np.random.default_rng(seed)
        self._until_ns: int | None = None
        self._turn = 0.0

    def command(
        self,
        t_ns: int,
        odometry_pose: Floats,  # noqa: ARG002 it knows nothing
        bits: NDArray[np.int8] | None,  # noqa: ARG002
        prediction: NDArray[np.float32] | None,  # noqa: ARG002
    ) -> tuple[float, float]:
        """Forward speed [m/s] and turning rate [rad/s]; see `agents.controllers.Controller`."""
        if self._until_ns is None or t_ns >= self._until_ns:
            begins_turn = self._until_ns is not None and self._turn == 0.0
            self._turn = self._control.turn_rad_s * float(self._random.choice([-1.0, 1.0])) if begins_turn else 0.0
            self._until_ns = t_ns + round(self._random.uniform(*(TURN_S if begins_turn else STRAIGHT_S)) * 1e9)
        return (0.0, self._turn) if self._turn else (self._control.speed_m_s, 0.0)
