"""The label rule's numbers, in one frozen value that the batch resolver, the store and the configuration share."""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class LabelRule:
    """When a reading labels a target of a frame.

    Attributes:
        position_tolerance_m: the reading must lie within this of the target.
        heading_tolerance_rad: and be turned by at most this from the target's heading; None: heading is ignored.
        window_s: longest time between frame and reading, past or future.
        window: "fixed" uses the clock alone, the paper's delta t; "drift" also wants the pose between the two known to
            `gate_m`, and weights each label by the probability that the reading truly lay within tolerance.
        gate_m: largest standard deviation of the relative position (its longest axis), for "drift" only.
    """

    position_tolerance_m: float
    heading_tolerance_rad: float | None = None
    window_s: float = 15.0
    window: Literal["fixed", "drift"] = "fixed"
    gate_m: float = 0.1

    @property
    def window_ns(self) -> int:
        """`window_s` in integer nanoseconds."""
        return round(self.window_s * 1e9)


@dataclass(frozen=True)
class OdometryLimits:
    """When odometry can be trusted to join two poses.

    Attributes:
        max_gap_s: two samples further apart in time than this end the trajectory; there is no pose between them.
        max_speed_m_s: two samples further apart in space than this allows are a pose jump, which ends it too.
        max_delay_s: how late, behind the newest odometry sample, a message may arrive and still count.
    """

    max_gap_s: float = 0.5
    max_speed_m_s: float = 3.0
    max_delay_s: float = 1.0
