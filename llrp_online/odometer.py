"""How far a robot has driven, by its own odometry."""

import math

from llrp_online.events import OdometrySample
from replay.rule import OdometryLimits


class Odometer:
    """Metres along the way, over all trajectories; a pose jump or a gap adds nothing.

    Jitter of a robot that stands adds up, as on any odometer: it is no use where odometry is noisier than driving.

    Args:
        limits: that tell a step from a jump.

    >>> import numpy as np
    >>> odometer = Odometer(OdometryLimits(max_gap_s=0.5, max_speed_m_s=1.0))
    >>> for t_s, x_m in ((0.0, 0.0), (0.1, 0.02), (0.2, 0.05), (0.3, 9.0)):
    ...     odometer.add(OdometrySample(round(t_s * 1e9), np.array([x_m, 0.0, 0.0]), None))
    >>> round(odometer.metres, 3)
    0.05
    """

    def __init__(self, limits: OdometryLimits) -> None:
        self._limits = limits
        self._last: tuple[int, float, float] | None = None
        self.metres = 0.0

    def add(self, sample: OdometrySample) -> None:
        """Go on to where the robot believes it is; a late message is none of its business."""
        x_m, y_m = sample.pose[:2].tolist()
        if not math.isfinite(x_m + y_m):
            return
        if self._last is not None:
            last_ns, last_x_m, last_y_m = self._last
            passed_s = (sample.t_ns - last_ns) * 1e-9
            step_m = math.hypot(x_m - last_x_m, y_m - last_y_m)
            if 0 < passed_s <= self._limits.max_gap_s and step_m <= self._limits.max_speed_m_s * passed_s:
                self.metres += step_m
        self._last = sample.t_ns, x_m, y_m

    def end_recording(self) -> None:
        """The next pose may be of another world."""
        self._last = None
