"""Driving on predictions with a budget of approaches: now and then it drives up to something until it feels it.

A robot that avoids what it foresees meets nothing any more, and the labels that obstacles give run dry, although its
network goes on learning. So a few times a minute it trusts its short-range sensors alone.
"""

import numpy as np
from numpy.typing import NDArray

from agents.controllers import Controller
from llrp_online.configuration.running import Control

Floats = NDArray[np.float64]

#: An approach that met nothing ends after this [s].
_LONGEST_S = 8.0


class Curious:
    """Two controllers, one at a time.

    Args:
        control: its `approaches_per_minute`.
        avoid: drives on predictions.
        reflex: drives on the short-range sensors, and turns away from what it feels.
    """

    def __init__(self, control: Control, avoid: Controller, reflex: Controller) -> None:
        self._avoid, self._reflex = avoid, reflex
        self._every_ns = 60e9 / control.approaches_per_minute if control.approaches_per_minute else np.inf
        self._next_ns: float | None = None
        self._began_ns = 0
        self._felt = False
        self.approaching = False

    def command(
        self,
        t_ns: int,
        odometry_pose: Floats,
        bits: NDArray[np.int8] | None,
        prediction: NDArray[np.float32] | None,
    ) -> tuple[float, float]:
        """Forward speed [m/s] and turning rate [rad/s]; see `agents.controllers.Controller`."""
        if self._next_ns is None:
            self._next_ns = t_ns + self._every_ns
        if not self.approaching and t_ns >= self._next_ns and bits is not None:
            self.approaching, self._felt, self._began_ns = True, False, t_ns
            self._next_ns += self._every_ns
        elif self.approaching and self._is_over(t_ns, bits):
            self.approaching = False
        if not self.approaching:
            return self._avoid.command(t_ns, odometry_pose, bits, prediction)
        self._avoid.command(t_ns, odometry_pose, bits, None)  # it stands still, and will not think it is stuck
        return self._reflex.command(t_ns, odometry_pose, bits, prediction)

    def _is_over(self, t_ns: int, bits: NDArray[np.int8] | None) -> bool:
        """It felt something and has turned away from it, or there was nothing to feel."""
        feels = bits is not None and bool((bits == 1).any())
        turned_away = self._felt and not feels
        self._felt |= feels
        return turned_away or t_ns - self._began_ns > _LONGEST_S * 1e9
