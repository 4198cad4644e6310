"""What controllers share that drive on what they feel, a move at a time: stand still without it, notice to be stuck."""

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

from agents.controllers.motion import StuckWatch
from llrp_online.configuration.running import Control

Floats = NDArray[np.float64]


class ByTouch(ABC):
    """Drives on the short-range bits; without recent bits it stands still.

    A subclass decides when a move is over, and calls `_begin` for the next.

    Args:
        control: speeds, and after how long it takes itself for stuck.
        seed: of its random choices.
    """

    def __init__(self, control: Control, seed: int) -> None:
        self._control = control
        self._rng = np.random.default_rng(seed)
        self._watch = StuckWatch(control.stuck_s)
        self._began_ns: int | None = None
        self._began: Floats = np.zeros(3)

    def command(
        self,
        t_ns: int,
        odometry_pose: Floats,
        bits: NDArray[np.int8] | None,
        prediction: NDArray[np.float32] | None,  # noqa: ARG002 these drive on what they feel
    ) -> tuple[float, float]:
        """Forward speed [m/s] and turning rate [rad/s]; see `agents.controllers.Controller`."""
        if bits is None:
            self._began_ns = None  # standing still is no sign of being stuck
            return 0.0, 0.0
        if self._began_ns is None:
            self._begin(t_ns, odometry_pose)
        self._decide(t_ns, odometry_pose, bits == 1, stuck=self._watch.stuck(t_ns, odometry_pose))
        return self._drive(odometry_pose)

    @abstractmethod
    def _decide(self, t_ns: int, pose: Floats, felt: NDArray[np.bool_], *, stuck: bool) -> None:
        """Go on with this move, or begin the next; `felt` (S,) sensors."""

    @abstractmethod
    def _drive(self, pose: Floats) -> tuple[float, float]:
        """Speed and turning rate of the move it is in."""

    def _begin(self, t_ns: int, pose: Floats) -> None:
        """A new move begins here."""
        self._began_ns, self._began = t_ns, pose
        self._watch.restart(t_ns, pose)

    def _went_m(self, pose: Floats) -> float:
        """How far it is from where this move began."""
        return float(np.hypot(*(pose[:2] - self._began[:2])))
