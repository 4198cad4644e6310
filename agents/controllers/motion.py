"""What moving controllers share: turning to a heading, slowing down at the end of a way, noticing to be stuck."""

import numpy as np
from numpy.typing import NDArray

from llrp_online.configuration.running import Control
from replay.poses import wrap

Floats = NDArray[np.float64]

# Proportional control: the remaining way shrinks by this share a second. Slow enough that wheels which need a quarter
# of a second to stop do not overshoot, and stable with a tenth of a second between odometry and wheels.
GAIN_PER_S = 4.0
HEADING_TOLERANCE_RAD = 0.02
WAY_TOLERANCE_M = 0.003
BACK_OFF_M = 0.05  # after a bump: enough for the rim to come free of what it leans on


def turning(error_rad: float, control: Control) -> float:
    """Rate [rad/s] that closes a heading error.

    >>> turning(3.0, Control(turn_rad_s=1.5))
    1.5
    """
    return float(np.clip(GAIN_PER_S * error_rad, -control.turn_rad_s, control.turn_rad_s))


def advancing(remaining_m: float, control: Control) -> float:
    """Speed [m/s] that closes a remaining way; negative backwards."""
    return float(np.clip(GAIN_PER_S * remaining_m, -control.speed_m_s, control.speed_m_s))


def heading_error(target_rad: float, pose: Floats) -> float:
    """How far to turn, the shorter way round."""
    return float(wrap(target_rad - pose[2]))


class StuckWatch:
    """Tells a robot that pushes against something it cannot feel, by odometry that stands still.

    >>> watch = StuckWatch(stuck_s=0.5)
    >>> watch.restart(0, np.zeros(3))
    >>> watch.stuck(400_000_000, np.zeros(3)), watch.stuck(600_000_000, np.zeros(3))
    (False, True)
    """

    def __init__(self, stuck_s: float) -> None:
        self._stuck_ns = round(stuck_s * 1e9)
        self._since_ns, self._pose = 0, np.zeros(3)

    def restart(self, t_ns: int, pose: Floats) -> None:
        """A new move begins here."""
        self._since_ns, self._pose = t_ns, pose

    def stuck(self, t_ns: int, pose: Floats) -> bool:
        """Whether the pose has stayed the same for too long."""
        moved = np.hypot(*(pose[:2] - self._pose[:2])) > WAY_TOLERANCE_M
        if moved or abs(heading_error(self._pose[2], pose)) > HEADING_TOLERANCE_RAD:
            self.restart(t_ns, pose)
        return t_ns - self._since_ns > self._stuck_ns
