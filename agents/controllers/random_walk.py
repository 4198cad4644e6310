"""A random walk: straight on until something is felt, then away from it by a random angle.

"A random-walk trajectory would eventually (albeit inefficiently) collect instances for all labels" (Nava et al. 2019,
section IV-C): the baseline of the acquisition behaviour, and a plain reflex to compare driving on predictions with.
"""

from enum import Enum

import numpy as np
from numpy.typing import NDArray

from agents.controllers.motion import (
    BACK_OFF_M,
    HEADING_TOLERANCE_RAD,
    WAY_TOLERANCE_M,
    advancing,
    heading_error,
    turning,
)
from agents.controllers.touch import ByTouch
from llrp_online.configuration.running import Control

Floats = NDArray[np.float64]

TURN_RAD = (np.pi / 3, np.pi)


class Phase(Enum):
    """What the robot is doing."""

    FORWARD = "forward"
    BACK_OFF = "back off"
    TURN = "turn"


class RandomWalk(ByTouch):
    """Drives on the short-range bits; without recent bits it stands still.

    It turns away from the side that feels more. If something is still felt after the turn, it turns on the same way
    round; if it is stuck, it first backs off a little.

    >>> walk = RandomWalk(Control(), seed=0)
    >>> walk.command(0, np.zeros(3), np.zeros(5, np.int8), None)
    (0.12, 0.0)
    >>> walk.command(1, np.zeros(3), np.array([1, 1, 0, 0, 0], np.int8), None)  # felt on the left: turns right
    (0.0, -1.5)
    """

    def __init__(self, control: Control, seed: int) -> None:
        super().__init__(control, seed)
        self._side = 1.0  # of the turn: 1 left, -1 right
        self._target_rad = 0.0
        self.phase = Phase.FORWARD

    def _decide(self, t_ns: int, pose: Floats, felt: NDArray[np.bool_], *, stuck: bool) -> None:
        phase = self._next_phase(pose, felt, stuck)
        if phase is not None:
            self.phase = phase
            self._begin(t_ns, pose)

    def _next_phase(self, pose: Floats, felt: NDArray[np.bool_], stuck: bool) -> Phase | None:
        """The phase to enter now, or None to go on with this one."""
        if self.phase is Phase.FORWARD:
            if not stuck and not felt.any():
                return None
            self._choose_side(felt)
            self._aim(pose)
            return Phase.BACK_OFF if stuck else Phase.TURN
        if self.phase is Phase.BACK_OFF:
            return Phase.TURN if stuck or abs(self._remaining_m(pose)) < WAY_TOLERANCE_M else None
        if stuck:
            return Phase.BACK_OFF
        if abs(heading_error(self._target_rad, pose)) >= HEADING_TOLERANCE_RAD:
            return None
        if felt.any():
            self._aim(pose)
            return Phase.TURN
        return Phase.FORWARD

    def _choose_side(self, felt: NDArray[np.bool_]) -> None:
        half = len(felt) // 2
        leftness = int(felt[:half].sum()) - int(felt[len(felt) - half :].sum())
        self._side = -float(np.sign(leftness)) if leftness else float(self._rng.choice([-1.0, 1.0]))

    def _aim(self, pose: Floats) -> None:
        self._target_rad = float(pose[2]) + self._side * float(self._rng.uniform(*TURN_RAD))

    def _remaining_m(self, pose: Floats) -> float:
        return self._went_m(pose) - BACK_OFF_M

    def _drive(self, pose: Floats) -> tuple[float, float]:
        if self.phase is Phase.FORWARD:
            return self._control.speed_m_s, 0.0
        if self.phase is Phase.BACK_OFF:
            return advancing(self._remaining_m(pose), self._control), 0.0
        return 0.0, turning(heading_error(self._target_rad, pose), self._control)
