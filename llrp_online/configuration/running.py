"""How agents meet and drive: transport, control, and what the simulated robot is made of. All may be left out."""

from typing import Literal, Self

from pydantic import Field, model_validator

from llrp_online.configuration.rig import Table


class Transport(Table):
    """[transport]: Zenoh."""

    endpoint: str = Field(
        default="tcp/127.0.0.1:7447", description="where agents meet; loopback unless you say otherwise"
    )
    stale_s: float = Field(default=0.5, gt=0, description="a command or prediction older than this means stop [s]")


class Control(Table):
    """[control]: what every controller shares, and the strokes of the acquisition behaviour."""

    speed_m_s: float = Field(default=0.12, gt=0, description="forward")
    turn_rad_s: float = Field(default=1.5, gt=0, description="in place")
    threshold: float = Field(
        default=0.15,
        gt=0,
        lt=1,
        description="predicted probability that counts as an obstacle; low, as running into one costs more than a turn",
    )
    clearance_m: float = Field(default=0.12, gt=0, description="predicted clearance at which it turns away")
    approaches_per_minute: float = Field(
        default=2.0, ge=0, description="`curious`: how often it drives up to something until a sensor feels it"
    )
    seek_speed_m_s: float = Field(default=0.18, gt=0, description="`seek`: forward, faster to meet more [m/s]")
    seek_turn_rad_s: float = Field(default=2.5, gt=0, description="`seek`: in place [rad/s]")
    closer_m: float = Field(
        default=0.03, ge=0, description="`seek`: how much closer it drives to what it feels before it turns away [m]"
    )
    stroke_m: float = Field(
        default=0.30, gt=0, description="acquisition: how far back and forth, the paper's 30 cm [m]"
    )
    directions_deg: list[float] = Field(
        default=[-30.0, -15.0, 0.0, 15.0, 30.0],
        min_length=1,
        description="acquisition: directions to look at an obstacle from, the paper's five; left is positive [deg]",
    )
    stuck_s: float = Field(default=0.6, gt=0, description="a move without odometry progress for this long is given up")
    give_up_s: float = Field(default=12.0, gt=0, description="acquisition: longest time for one stroke or one turn")


class Simulation(Table):
    """[simulation]: the simulated robot's body, wheels and sensors. Distances ahead are from the middle of the axle."""

    kind: Literal["thymio"] = Field(default="thymio")
    rate_hz: float = Field(default=20.0, gt=0, description="odometry, short range and control")
    camera_divider: int = Field(default=2, ge=1, description="a picture every so many ticks")

    radius_m: float = Field(default=0.055, gt=0, description="the body is a disc, 11 cm wide [m]")
    centre_ahead_m: float = Field(default=0.025, ge=0, description="the disc's centre, ahead of the axle [m]")
    track_m: float = Field(default=0.095, gt=0, description="between the wheels [m]")
    wheel_limit_m_s: float = Field(default=0.2, gt=0, description="fastest a wheel can roll [m/s]")
    wheel_acceleration_m_s2: float = Field(
        default=0.5, gt=0, description="how fast a wheel changes its speed: from 0.12 m/s it stops within 1.5 cm"
    )
    slip: float = Field(default=0.02, ge=0, description="deviation of a wheel's step, relative, after one centimetre")
    bias: float = Field(default=0.005, ge=0, description="deviation of a wheel's radius, relative, drawn once a run")

    beams_deg: list[float] = Field(
        default=[-40.0, -20.0, 0.0, 20.0, 40.0],
        min_length=1,
        description="proximity sensors on the disc's rim, right to left as a LaserScan counts, evenly spaced [deg]",
    )
    beam_width_deg: float = Field(default=12.0, ge=0, description="the cone one sensor feels in; 0: a single ray [deg]")
    beam_height_m: float = Field(default=0.03, gt=0, description="proximity sensors, above the floor [m]")
    range_m: float = Field(default=0.10, gt=0, description="reach of a proximity sensor [m]")
    range_noise_m: float = Field(default=0.003, ge=0, description="its noise [m]")

    # The picture's top edge meets the floor where the last target but two still matters: 28 cm + `range_m` ahead of
    # the sensors. Flatter would show what no label can ever teach, steeper would hide what the labels speak of.
    pitch_deg: float = Field(default=46.0, ge=0, le=90, description="camera, downward")
    field_of_view_deg: float = Field(default=68.0, gt=0, lt=180, description="camera, from left edge to right edge")
    camera_height_m: float = Field(default=0.12, gt=0, description="camera, above the floor [m]")
    camera_ahead_m: float = Field(default=0.08, description="camera, ahead of the axle: above the middle sensor [m]")
    exposure: float = Field(
        default=1.0, gt=0, description="camera: all it sees is so many times as bright; white is the brightest"
    )
    blur_px: float = Field(default=0.0, ge=0, le=10, description="camera out of focus: deviation of its blur [px]")
    shutter_s: float = Field(
        default=0.0, ge=0, description="camera's shutter is open so long, one tick at most: what moves is smeared [s]"
    )

    @model_validator(mode="after")
    def _shutter_closes_in_time(self) -> Self:
        if self.shutter_s * self.rate_hz > 1.0 + 1e-9:
            raise ValueError(
                f"shutter_s: expected at most one tick, {1 / self.rate_hz:g} s at rate_hz = {self.rate_hz:g}, "
                f"got {self.shutter_s:g}; close the shutter sooner, or lower rate_hz"
            )
        return self


class Keys(Table):
    """[keys]: what topics are called on Zenoh, and in ROS 2."""

    mapping: Literal["plain", "ros2-zenoh", "ros2-dds"] = Field(
        default="plain",
        description="`plain`: the robot's name and the topic; `ros2-zenoh`: as rmw_zenoh; `ros2-dds`: as "
        "zenoh-bridge-ros2dds",
    )
    domain: int | None = Field(
        default=None, ge=0, le=232, description="ROS 2 domain; left out: ROS_DOMAIN_ID of the environment, else 0"
    )
    namespace: str = Field(
        default="",
        pattern=r"^([A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*)?$",
        description="ROS 2 namespace of the robot's topics: `bot1` makes `/bot1/odom` of `odom`",
    )
    command_topic: str = Field(
        default="cmd_vel",
        pattern=r"^[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*$",
        description="where ROS 2 takes commands, below the namespace; agents call it `cmd_vel`",
    )
    command_stamped: bool = Field(
        default=False, description="commands as TwistStamped, stamped by the sensors' clock, rather than Twist"
    )
