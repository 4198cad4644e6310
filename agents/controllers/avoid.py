"""Driving on predictions alone: go where the picture says the sensors would stay silent.

From the predicted probabilities comes a clearance for each sensor: how far ahead the robot could stand before that
sensor felt something. The least of them sets the speed; a way that is not clear is turned away from, towards the side
with more room, and a turn once begun is finished. The proximity sensors may be off.
"""

import numpy as np
from numpy.typing import NDArray

from llrp_online.configuration.running import Control
from replay.targets import Targets

Floats = NDArray[np.float64]

#: Neighbouring targets whose probabilities are averaged: one of thirty alone may err.
_SMOOTH = 3
#: A turn ends when the way is clear by this much more than the clearance that began it.
_CLEAR_FACTOR = 1.25


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
    >>> avoid.command(0, np.zeros(3), None, None)
    (0.0, 0.0)
    """

    def __init__(self, control: Control, targets: Targets, sensors: list[str], seed: int) -> None:
        if np.any(targets.poses[:, 1:] != 0) or np.any(np.diff(targets.poses[:, 0]) <= 0):
            raise ValueError('avoid: expected [targets] kind = "line", straight ahead: clearance is read along it')
        self._control = control
        self._ahead_m = targets.poses[:, 0]
        self._sensors = len(sensors)
        self._random = np.random.default_rng(seed)
        self._turning = 0.0

    def command(
        self,
        t_ns: int,  # noqa: ARG002 predictions are enough
        odometry_pose: Floats,  # noqa: ARG002
        bits: NDArray[np.int8] | None,  # noqa: ARG002
        prediction: NDArray[np.float32] | None,
    ) -> tuple[float, float]:
        """Forward speed [m/s] and turning rate [rad/s]; see `agents.controllers.Controller`."""
        if prediction is None:
            return 0.0, 0.0
        control = self._control
        clearance_m = self.clearance_m(prediction)
        nearest_m = float(clearance_m.min())
        if self._turning:
            if nearest_m < control.clearance_m * _CLEAR_FACTOR:
                return 0.0, self._turning
            self._turning = 0.0
        if nearest_m < control.clearance_m:
            self._turning = self._side(clearance_m) * control.turn_rad_s
            return 0.0, self._turning
        slow = np.clip((nearest_m - control.clearance_m) / control.clearance_m, 0.3, 1.0)
        return float(control.speed_m_s * slow), 0.0

    def clearance_m(self, prediction: NDArray[np.float32]) -> Floats:
        """How far ahead each sensor stays silent: (T, S) probabilities -> (S,) metres."""
        kernel = np.ones(_SMOOTH) / _SMOOTH
        padded = np.pad(prediction, ((_SMOOTH // 2, _SMOOTH // 2), (0, 0)), mode="edge")
        smooth = np.stack([np.convolve(column, kernel, "valid") for column in padded.T], -1)
        felt = smooth > self._control.threshold
        first = np.where(felt.any(0), felt.argmax(0), len(self._ahead_m) - 1)
        return self._ahead_m[first]

    def _side(self, clearance_m: Floats) -> float:
        """+1 to turn left, -1 to turn right: away from the side with less room."""
        half = self._sensors // 2
        left, right = clearance_m[:half].sum(), clearance_m[self._sensors - half :].sum()
        if left == right:
            return float(self._random.choice([-1.0, 1.0]))
        return 1.0 if left > right else -1.0
