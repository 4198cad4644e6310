"""How agents meet and drive: transport, control, and what the simulated robot is made of. All may be left out."""

from typing import Literal

from pydantic import Field

from llrp_online.configuration.rig import Table


class Transport(Table):
    """[transport]: Zenoh."""

    endpoint: str = Field(
        default="tcp/127.0.0.1:7447", description="where agents meet; loopback unless you say otherwise"
    )
    stale_s: float = Field(default=0.5, gt=0, description="a command or prediction older than this means stop [s]")


class Control(Table):
    """[control]: speeds of every controller."""

    speed_m_s: float = Field(default=0.12, gt=0, description="forward")
    turn_rad_s: float = Field(default=1.5, gt=0, description="in place")
    threshold: float = Field(default=0.5, gt=0, lt=1, description="predicted probability that counts as an obstacle")
    clearance_m: float = Field(default=0.12, gt=0, description="predicted clearance at which it turns away")


class Simulation(Table):
    """[simulation]: the simulated robot's body, wheels and sensors."""

    kind: Literal["thymio"] = Field(default="thymio")
    rate_hz: float = Field(default=20.0, gt=0, description="odometry, short range and control")
    camera_divider: int = Field(default=2, ge=1, description="a picture every so many ticks")
    slip: float = Field(default=0.02, ge=0, description="deviation of a wheel's step, relative, after one centimetre")
    bias: float = Field(default=0.005, ge=0, description="deviation of a wheel's radius, relative, drawn once a run")
    range_m: float = Field(default=0.10, gt=0, description="reach of a proximity sensor [m]")
    range_noise_m: float = Field(default=0.003, ge=0, description="its noise [m]")
    pitch_deg: float = Field(default=46.0, ge=0, le=90, description="camera, downward")
    camera_height_m: float = Field(default=0.12, gt=0, description="camera, above the floor [m]")
