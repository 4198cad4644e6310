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
    StuckWatch,
    advancing,
    heading_error,
    turning,
)
from llrp_online.configuration.running import Control

Floats = NDArray[np.float64]

TURN_RAD = (np.pi / 3, np.pi)


class Phase(Enum):
    """What the robot is doing."""

    FORWARD = "forward"
    BACK_OFF = "back off"
    TURN = "turn"


class RandomWalk:
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
        self._control = control
        self._rng = np.random.default_rng(seed)
        self._watch = StuckWatch(control.stuck_s)
        self._side = 1.0  # of the turn: 1 left, -1 right
        self._target_rad = 0.0
        self._began: Floats | None = None
        self.phase = Phase.FORWARD

    def command(
        self,
        t_ns: int,
        odometry_pose: Floats,
        bits: NDArray[np.int8] | None,
        prediction: NDArray[np.float32] | None,  # noqa: ARG002 this one drives on what it feels
    ) -> tuple[float, float]:
        """Forward speed [m/s] and turning rate [rad/s]; see `agents.controllers.Controller`."""
        if bits is None:
            self._began = None  # standing still is no sign of being stuck
            return 0.0, 0.0
        if self._began is None:
            self._began = odometry_pose
            self._watch.restart(t_ns, odometry_pose)
        phase = self._next_phase(odometry_pose, bits == 1, self._watch.stuck(t_ns, odometry_pose))
        if phase is not None:
            self.phase, self._began = phase, odometry_pose
            self._watch.restart(t_ns, odometry_pose)
        return self._drive(odometry_pose)

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
        began = pose if self._began is None else self._began
        return float(np.hypot(*(pose[:2] - began[:2]))) - BACK_OFF_M

    def _drive(self, pose: Floats) -> tuple[float, float]:
        if self.phase is Phase.FORWARD:
            return self._control.speed_m_s, 0.0
        if self.phase is Phase.BACK_OFF:
            return advancing(self._remaining_m(pose), self._control), 0.0
        return 0.0, turning(heading_error(self._target_rad, pose), self._control)
