"""A real Thymio: where it is plugged in, what its units mean, and its camera. The keys of [thymio]."""

from pydantic import Field

from llrp_online.configuration.rig import Table


class Thymio(Table):
    """[thymio]: a real Thymio and its camera, for `llrp robot --kind thymio`. `llrp calibrate` measures the numbers."""

    port: str = Field(
        default="", description="/dev/ttyACM0, or tcp/HOST:PORT; empty: the first Thymio or dongle on USB"
    )
    speed_unit_m_s: float = Field(
        default=0.00034, gt=0, description="what one unit of the firmware's wheel speed is in truth"
    )
    left_scale: float = Field(default=1.0, gt=0.5, lt=2, description="the left wheel's way, beside the unit's")
    right_scale: float = Field(default=1.0, gt=0.5, lt=2, description="the right wheel's way, beside the unit's")
    track_m: float = Field(default=0.095, gt=0, description="between the wheels")
    wheel_noise_m_per_sqrt_m: float = Field(
        default=0.005, ge=0, description="deviation of a wheel's way after one metre, for the covariance [m/√m]"
    )
    proximity_peak: float = Field(default=4505.0, gt=0, description="what a proximity sensor says when it is touched")
    proximity_half_m: float = Field(
        default=0.0854, gt=0, description="how far something white is when a proximity sensor says half of that"
    )
    camera: str = Field(
        default="0",
        description="for OpenCV: a camera's number, a file, or an address such as rtsp://...; empty: none",
    )
    camera_width_px: int = Field(default=640, ge=16, description="what is asked of the camera [px]")
    camera_height_px: int = Field(default=480, ge=16, description="what is asked of the camera [px]")
    camera_rate_hz: float = Field(default=10.0, gt=0, description="pictures sent, at most")
    camera_delay_s: float = Field(
        default=0.0, ge=0, lt=2, description="from the light to the picture's arrival here; its stamp is earlier by it"
    )
    camera_frozen_s: float = Field(
        default=2.0, gt=0, description="the same picture, or none, for so long: the camera counts as frozen"
    )
