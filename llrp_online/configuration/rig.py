"""What a robot is: its cameras, odometry, short-range sensors, targets and label rule. The keys of a robot's TOML."""

from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from llrp_online.configuration.field import Field as Way
from llrp_online.motion_noise import MotionNoise
from replay.rule import LabelRule, OdometryLimits
from replay.targets import Targets


class Table(BaseModel):
    """A TOML table: frozen, and an unknown key is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Robot(Table):
    """[robot]."""

    name: str = Field(pattern=r"^[a-zA-Z][a-zA-Z0-9_-]*$", description="prefix of every topic on the wire")
    camera_sync_s: float = Field(
        default=0.05, gt=0, description="pictures of several cameras this close are one frame [s]"
    )


class Camera(Table):
    """[[camera]]: one table a camera."""

    topic: str = Field(description="CompressedImage or Image topic, relative to the robot's name")
    width: int = Field(ge=8, le=1024, description="columns of the picture the network sees [px]")
    height: int = Field(ge=8, le=1024, description="rows of the picture the network sees [px]")
    type: Literal["sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Image"] = Field(
        default="sensor_msgs/msg/CompressedImage", description="of its messages, where the sender does not say"
    )
    swap: str | None = Field(
        default=None,
        description="topic of the camera that takes this one's place in a flipped world; itself if it looks ahead",
    )


class Odometry(Table):
    """[odometry]."""

    topic: str = Field(default="odom", description="nav_msgs/Odometry topic")
    max_gap_s: float = Field(default=0.5, gt=0, description="samples further apart in time end the trajectory [s]")
    max_speed_m_s: float = Field(default=3.0, gt=0, description="samples further apart in space are a pose jump [m/s]")
    max_delay_s: float = Field(default=1.0, ge=0, description="how late a message may come and still count [s]")
    trust_covariance: bool = Field(
        default=True, description="take the covariance that comes with the odometry; false: the noise given below"
    )
    heading_noise_rad_per_sqrt_rad: float = Field(
        default=0.03, ge=0, description="heading deviation after a turn of one radian, where no covariance is given"
    )
    heading_noise_rad_per_sqrt_m: float = Field(
        default=0.03, ge=0, description="heading deviation after one metre, where no covariance is given"
    )
    position_noise_m_per_sqrt_m: float = Field(
        default=0.02, ge=0, description="position deviation after one metre, where no covariance is given"
    )

    def limits(self) -> OdometryLimits:
        """The same, as the trajectory store takes it."""
        return OdometryLimits(self.max_gap_s, self.max_speed_m_s, self.max_delay_s)

    def noise(self) -> MotionNoise:
        """Of a step for which no covariance is given."""
        return MotionNoise(
            self.heading_noise_rad_per_sqrt_rad, self.heading_noise_rad_per_sqrt_m, self.position_noise_m_per_sqrt_m
        )


class ShortRange(Table):
    """[[short_range]]: one table a sensor, left to right. Exactly one of `below` and `above`."""

    name: str
    topic: str = Field(default="range", description="the message the reading comes in")
    type: str = Field(
        default="sensor_msgs/msg/LaserScan",
        pattern=r"^\w+/msg/\w+$",
        description="of its messages, where the sender does not say, as a plain ROS 2 bridge on Zenoh does not",
    )
    field: str = Field(
        description="where in the message: `range`, `ranges[3]`, `ranges[-15deg:15deg]`, "
        "`readings[header.frame_id=left].value`, `latest [bumper=0].state`"
    )
    below: float | None = Field(default=None, description="the bit is 1 below this value")
    above: float | None = Field(default=None, description="the bit is 1 above this value")
    swap: str | None = Field(default=None, description="name of the sensor that is this one's mirror image")

    @model_validator(mode="after")
    def _one_threshold(self) -> Self:
        if (self.below is None) == (self.above is None):
            raise ValueError("expected exactly one of `below` and `above`")
        Way.parse(self.field)
        return self

    def way(self) -> Way:
        """Its `field`, parsed."""
        return Way.parse(self.field)


class LineTargets(Table):
    """[targets] kind = "line": along the robot's axis, both ends included."""

    kind: Literal["line"]
    start_m: float
    stop_m: float
    step_m: float = Field(gt=0)

    def build(self) -> Targets:
        """The poses."""
        return Targets.line(self.start_m, self.stop_m, self.step_m)


Axis = tuple[float, float, Annotated[float, Field(gt=0)]]


class GridTargets(Table):
    """[targets] kind = "grid": each axis as [start, stop, step], x outer and y inner."""

    kind: Literal["grid"]
    x_m: Axis
    y_m: Axis

    def build(self) -> Targets:
        """The poses."""
        return Targets.grid(self.x_m, self.y_m)


class ListTargets(Table):
    """[targets] kind = "list": poses one by one, [[x_m, y_m, yaw_rad], ...]."""

    kind: Literal["list"]
    poses: list[tuple[float, float, float]] = Field(min_length=1)

    def build(self) -> Targets:
        """The poses."""
        return Targets.listed(self.poses)


class Labels(Table):
    """[labels]: the label rule."""

    position_tolerance_m: float = Field(gt=0, description="a reading labels a target within this distance [m]")
    heading_tolerance_rad: float | None = Field(
        default=None, gt=0, description="and turned by at most this; left out: heading is ignored [rad]"
    )
    window: Literal["fixed", "drift"] = Field(
        default="fixed", description="what closes the window: the clock, or the drift"
    )
    window_s: float = Field(
        default=15.0, gt=0, description="longest time between frame and reading, past or future [s]"
    )
    gate_m: float | None = Field(
        default=None,
        gt=0,
        description="`drift`: largest deviation of the relative position; left out: the tolerance [m]",
    )

    def rule(self) -> LabelRule:
        """The same, as the trajectory store takes it."""
        gate_m = self.position_tolerance_m if self.gate_m is None else self.gate_m
        return LabelRule(self.position_tolerance_m, self.heading_tolerance_rad, self.window_s, self.window, gate_m)
