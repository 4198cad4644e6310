"""Driving on predictions alone: go where the picture says the sensors would stay silent.

From the predicted probabilities comes a clearance for each sensor: how far ahead the robot could stand before that
sensor felt something. The least of them sets the speed, and too little of it begins a turn towards the side with more
room, which goes on until the way is clear. An obstacle close by is below or beside the picture, so what an earlier
picture said of a place is remembered while the robot drives there (`Belief`). What no picture showed still stops the
wheels: the robot notices by its odometry, backs off a little, turns well away, and does not drive at that place again
for a while (`Bumps`). The proximity sensors may be off.
"""

from enum import Enum

import numpy as np
from numpy.typing import NDArray

from agents.controllers.bumps import Bumps
from agents.controllers.motion import StuckWatch
from llrp_online.configuration.running import Control
from replay.poses import relative
from replay.targets import Targets

Floats = NDArray[np.float64]

#: Neighbouring targets whose probabilities are averaged: one of thirty alone may err.
_SMOOTH = 3
#: A turn ends when the way is clear by this much more than the clearance that began it.
_CLEAR_FACTOR = 1.5
#: The outermost sensors look past the body: they count within this share of the clearance.
_SIDE_SHARE = 0.7
#: In a corner no direction may be clear enough: what is asked for falls to nothing over this long a turn.
_LONGEST_TURN_S = 8.0
_BACK_S = 0.8
_FORGET_RAD = 0.15
#: A remembered probability falls to this share over this way.
_FADE, _FADE_WAY_M = 0.95, 0.1
#: How far it turns away from what no picture showed [s].
_BLIND_TURN_S = (0.6, 1.4)


class Belief:
    """What pictures have said of the places ahead, carried along by odometry.

    Driving straight moves every remembered probability nearer by the way driven; it fades, so that a mistake is
    forgotten. A turn shows other places, and all is forgotten.

    >>> belief = Belief(np.array([0.0, 0.1, 0.2]))
    >>> _ = belief.update(np.array([[0.0], [0.0], [1.0]]), np.zeros(3))
    >>> belief.update(np.zeros((3, 1)), np.array([0.1, 0.0, 0.0])).ravel().round(2).tolist()
    [0.0, 0.95, 0.0]
    """

    def __init__(self, ahead_m: Floats) -> None:
        self._ahead_m = ahead_m
        self._values: Floats | None = None
        self._pose = np.zeros(3)
        self._turned_rad = 0.0

    def update(self, prediction: NDArray[np.float32] | Floats, pose: Floats) -> Floats:
        """Take in a prediction (T, S) made at a pose (3,); the belief (T, S)."""
        seen = np.asarray(prediction, np.float64)
        step = relative(self._pose, pose)
        self._pose = pose
        self._turned_rad += abs(float(step[2]))
        if self._values is None or self._turned_rad > _FORGET_RAD:
            self._values, self._turned_rad = seen, 0.0
            return self._values
        moved = self._ahead_m + step[0]
        columns = [np.interp(moved, self._ahead_m, column, right=0.0) for column in self._values.T]
        fade = _FADE ** (abs(float(step[0])) / _FADE_WAY_M)
        self._values = np.maximum(seen, fade * np.stack(columns, -1))
        return self._values


class Phase(Enum):
    """What the robot is doing."""

    DRIVE = "drive"
    TURN = "turn"
    BACK = "back"


class Avoid:
    """Speed and turning from predicted clearance.

    Args:
        control: speeds, the probability that counts as an obstacle, the clearance at which it turns away.
        targets: along the robot's axis; ValueError for any other.
        sensors: names, left to right.
        seed: of the side chosen where both are alike.

    >>> avoid = Avoid(Control(), Targets.line(0.0, 0.3, 0.01), ["left", "center", "right"], seed=0)
    >>> clear = np.zeros((31, 3), np.float32)
    >>> avoid.command(0, np.zeros(3), None, clear)
    (0.12, 0.0)
    >>> avoid.command(1, np.zeros(3), None, None)
    (0.0, 0.0)
    """

    def __init__(self, control: Control, targets: Targets, sensors: list[str], seed: int) -> None:
        if np.any(targets.poses[:, 1:] != 0) or np.any(np.diff(targets.poses[:, 0]) <= 0):
            raise ValueError('avoid: expected [targets] kind = "line", straight ahead: clearance is read along it')
        self._control = control
        self._ahead_m = targets.poses[:, 0]
        self._outer = [0, len(sensors) - 1] if len(sensors) > 2 else []
        self._middle = [i for i in range(len(sensors)) if i not in self._outer]
        self._random = np.random.default_rng(seed)
        self._watch = StuckWatch(control.stuck_s)
        self._belief, self._bumps = Belief(self._ahead_m), Bumps()
        self._side = 1.0
        self._least_turn_s = 0.0
        self._began_ns: int | None = None
        self.phase = Phase.DRIVE

    def command(
        self,
        t_ns: int,
        odometry_pose: Floats,
        bits: NDArray[np.int8] | None,  # noqa: ARG002 predictions are enough
        prediction: NDArray[np.float32] | None,
    ) -> tuple[float, float]:
        """Forward speed [m/s] and turning rate [rad/s]; see `agents.controllers.Controller`."""
        if prediction is None:
            self._began_ns = None
            return 0.0, 0.0
        if self._began_ns is None:
            self._enter(self.phase, t_ns, odometry_pose)
        clearance_m = self.clearance_m(self._belief.update(prediction, odometry_pose))
        self._decide(t_ns, odometry_pose, clearance_m)
        return self._drive(clearance_m)

    def clearance_m(self, prediction: NDArray[np.float32] | Floats) -> Floats:
        """How far ahead each sensor stays silent: (T, S) probabilities -> (S,) metres."""
        kernel = np.ones(_SMOOTH) / _SMOOTH
        padded = np.pad(prediction, ((_SMOOTH // 2, _SMOOTH // 2), (0, 0)), mode="edge")
        smooth = np.stack([np.convolve(column, kernel, "valid") for column in padded.T], -1)
        felt = smooth > self._control.threshold
        first = np.where(felt.any(0), felt.argmax(0), len(self._ahead_m) - 1)
        return self._ahead_m[first]

    def _decide(self, t_ns: int, pose: Floats, clearance_m: Floats) -> None:
        """Go on as it is, or enter the next phase."""
        since_s = 0.0 if self._began_ns is None else (t_ns - self._began_ns) * 1e-9
        bump_m = self._bumps.ahead(t_ns, pose)
        if self.phase is Phase.BACK:
            if since_s > _BACK_S:
                self._side = -self._side
                self._enter(Phase.TURN, t_ns, pose)
                self._least_turn_s = float(self._random.uniform(*_BLIND_TURN_S))
        elif self._watch.stuck(t_ns, pose):
            self._bumps.add(t_ns, pose)
            self._enter(Phase.BACK, t_ns, pose)
        elif self.phase is Phase.DRIVE and bump_m is not None:
            self._side = -1.0 if bump_m > 0 else 1.0
            self._enter(Phase.TURN, t_ns, pose)
        elif self.phase is Phase.DRIVE and not self._is_clear(clearance_m, 1.0):
            self._side = self._roomier_side(clearance_m)
            self._enter(Phase.TURN, t_ns, pose)
        elif self.phase is Phase.TURN and since_s >= self._least_turn_s:
            factor = _CLEAR_FACTOR * max(0.0, 1 - since_s / _LONGEST_TURN_S)
            if bump_m is None and self._is_clear(clearance_m, factor):
                self._enter(Phase.DRIVE, t_ns, pose)

    def _enter(self, phase: Phase, t_ns: int, pose: Floats) -> None:
        self.phase, self._began_ns, self._least_turn_s = phase, t_ns, 0.0
        self._watch.restart(t_ns, pose)

    def _is_clear(self, clearance_m: Floats, factor: float) -> bool:
        wanted_m = factor * self._control.clearance_m
        beside = bool((clearance_m[self._outer] >= _SIDE_SHARE * wanted_m).all())
        return beside and bool((clearance_m[self._middle] >= wanted_m).all())

    def _drive(self, clearance_m: Floats) -> tuple[float, float]:
        control = self._control
        if self.phase is Phase.BACK:
            return -control.speed_m_s / 2, 0.0
        if self.phase is Phase.TURN:
            return 0.0, self._side * control.turn_rad_s
        ahead_m = float(clearance_m[self._middle].min())
        return float(control.speed_m_s * np.clip(ahead_m / control.clearance_m - 1, 0.3, 1.0)), 0.0

    def _roomier_side(self, clearance_m: Floats) -> float:
        """+1 to turn left, -1 to turn right."""
        half = len(clearance_m) // 2
        left, right = clearance_m[:half].sum(), clearance_m[len(clearance_m) - half :].sum()
        if left == right:
            return float(self._random.choice([-1.0, 1.0]))
        return 1.0 if left > right else -1.0
