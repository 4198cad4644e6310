"""Seeking the labels that the memory lacks: what was not met yet, along lines that were not driven yet.

What a drive is short of are readings that felt something, each at another thing. One run straight up to a thing labels
every frame taken on the way, at all distances at once: nearly as much as the paper's ten strokes say of it, in a tenth
of the time. Hence: forward until something is felt, a little closer still, and away at once, along the line of which
least is known by a coarse map (`Known`).
"""

import math
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from agents.controllers.known import CELL_M, Known
from agents.controllers.motion import BACK_OFF_M, WAY_TOLERANCE_M, heading_error, turning
from agents.controllers.touch import ByTouch
from llrp_online.configuration.running import Control

Floats = NDArray[np.float64]

HEADINGS = 32  # considered before each turn
SETTLED_RAD = 0.15  # runs are straight whichever way they go: waiting for the exact heading would only cost time
ONWARD_RAD = 0.4  # turned further by this while something is still felt
THING_M = 0.15  # from the robot's middle to what it feels, about


class Phase(Enum):
    """What the robot is doing."""

    FORWARD = "forward"
    CLOSER = "closer"
    BACK_OFF = "back off"
    TURN = "turn"


class Seek(ByTouch):
    """Drives on the short-range bits, faster than others do; without recent bits it stands still.

    >>> seek = Seek(Control(), seed=0)
    >>> seek.command(0, np.zeros(3), np.zeros(5, np.int8), None)
    (0.18, 0.0)
    """

    def __init__(self, control: Control, seed: int) -> None:
        fast = {"speed_m_s": control.seek_speed_m_s, "turn_rad_s": control.seek_turn_rad_s}
        super().__init__(control.model_copy(update=fast), seed)
        self._known = Known()
        self._target_rad = 0.0
        self._side = 1.0  # of the turn: 1 left, -1 right
        self._onward = 0  # how often this turn was prolonged
        self.phase = Phase.FORWARD

    def _decide(self, t_ns: int, pose: Floats, felt: NDArray[np.bool_], *, stuck: bool) -> None:
        self._known.drove(pose)
        self._act(t_ns, pose, felt=bool(felt.any()), stuck=stuck)

    def _act(self, t_ns: int, pose: Floats, *, felt: bool, stuck: bool) -> None:
        """Go on as it is, or enter the next phase."""
        if stuck and self.phase is not Phase.BACK_OFF:
            self._known.met(t_ns, pose, CELL_M)
            self._enter(Phase.BACK_OFF, t_ns, pose)
        elif self.phase is Phase.FORWARD and felt:
            self._known.met(t_ns, pose, THING_M)
            self._enter(Phase.CLOSER, t_ns, pose)
        elif self.phase is Phase.TURN and abs(heading_error(self._target_rad, pose)) < SETTLED_RAD:
            self._end_turn(t_ns, pose, felt=felt)
        elif self._has_arrived(pose, felt=felt, stuck=stuck):
            self._turn_to_what_is_new(t_ns, pose)

    def _has_arrived(self, pose: Floats, *, felt: bool, stuck: bool) -> bool:
        """Close enough, or far enough back, to turn away?"""
        if self.phase is Phase.CLOSER:
            return not felt or self._went_m(pose) >= self._control.closer_m
        return self.phase is Phase.BACK_OFF and (stuck or self._went_m(pose) >= BACK_OFF_M - WAY_TOLERANCE_M)

    def _turn_to_what_is_new(self, t_ns: int, pose: Floats) -> None:
        headings = float(pose[2]) + self._rng.uniform(-np.pi, np.pi, HEADINGS)
        worth = [self._known.novelty(t_ns, pose, heading) for heading in headings.tolist()]
        self._target_rad = float(headings[int(np.argmax(worth))])
        self._side, self._onward = math.copysign(1.0, heading_error(self._target_rad, pose)), 0
        self._enter(Phase.TURN, t_ns, pose)

    def _end_turn(self, t_ns: int, pose: Floats, *, felt: bool) -> None:
        """Forward; or on round while something is felt there; or, felt all around, slowly out of the nook."""
        if not felt:
            self._enter(Phase.FORWARD, t_ns, pose)
        elif self._onward * ONWARD_RAD < 2 * math.pi:
            self._known.met(t_ns, pose, THING_M)
            self._onward += 1
            self._target_rad += self._side * ONWARD_RAD
        else:
            self._enter(Phase.CLOSER, t_ns, pose)

    def _enter(self, phase: Phase, t_ns: int, pose: Floats) -> None:
        self.phase = phase
        self._begin(t_ns, pose)

    def _drive(self, pose: Floats) -> tuple[float, float]:
        if self.phase is Phase.TURN:
            return 0.0, turning(heading_error(self._target_rad, pose), self._control)
        return (-1.0 if self.phase is Phase.BACK_OFF else 1.0) * self._control.speed_m_s, 0.0
