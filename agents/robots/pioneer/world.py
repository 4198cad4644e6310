"""What the Pioneer's world is made of, as `configs/worlds/pioneer.toml` says it (Nava et al. 2019, section V-C)."""

from pathlib import Path
from typing import Self

from pydantic import Field, model_validator

from llrp_online.configuration import Table, load_toml


class FloorTable(Table):
    """[floor]: noise on a lattice, black below its middle and white above."""

    side_m: float = Field(gt=1, description="of the square map [m]")
    cell_m: float = Field(gt=0, description="distance of the noise's lattice points: the lower its frequency [m]")
    texel_m: float = Field(gt=0, description="finest detail of the map [m]")
    beyond: int = Field(default=128, ge=0, le=255, description="grey of all that is not the map")


class DriveTable(Table):
    """[drive]: how the robot moves, straight on at one speed, turning now a little, now more."""

    rate_hz: float = Field(gt=0, description="odometry, sensor and pictures")
    speed_m_s: float = Field(gt=0, description="forward, always")
    turn_deg_s: float = Field(ge=0, description="largest angular speed to either side")
    turn_every_s: float = Field(gt=0, description="a new angular speed is drawn this often [s]")
    margin_m: float = Field(ge=0, description="nearer to the edge than this, it is put back to the middle [m]")


class SensorTable(Table):
    """[sensor]: looks straight down."""

    side_m: float = Field(gt=0, description="of the square of floor that it sees, along the map's axes [m]")


class BodyTable(Table):
    """[body]: a grey box around the robot's middle, the cameras above it."""

    length_m: float = Field(gt=0, description="along the robot's axis [m]")
    width_m: float = Field(gt=0, description="across it [m]")
    height_m: float = Field(gt=0, description="of its top above the floor [m]")
    grey: int = Field(default=128, ge=0, le=255, description="of its top")


class CameraTable(Table):
    """[[camera]]: a pinhole above the robot's middle. All angles zero: level, straight ahead."""

    height_m: float = Field(gt=0, description="above the floor [m]")
    ahead_m: float = Field(default=0.0, description="of the robot's middle [m]")
    left_m: float = Field(default=0.0, description="of the robot's middle [m]")
    yaw_deg: float = Field(default=0.0, description="to the left")
    pitch_deg: float = Field(default=0.0, description="downward")
    roll_deg: float = Field(default=0.0, description="clockwise, seen from behind")
    field_of_view_deg: float = Field(gt=0, lt=180, description="from left edge to right edge")


class PioneerWorld(Table):
    """The whole of the TOML."""

    floor: FloorTable
    drive: DriveTable
    sensor: SensorTable
    body: BodyTable
    camera: list[CameraTable] = Field(min_length=1)

    @model_validator(mode="after")
    def _cameras_stand_above(self) -> Self:
        for number, camera in enumerate(self.camera):
            if camera.height_m <= self.body.height_m:
                raise ValueError(
                    f"camera[{number}].height_m: expected more than body.height_m = {self.body.height_m:g}, "
                    f"got {camera.height_m:g}"
                )
        return self


def load_world(path: str | Path) -> PioneerWorld:
    """Read a world's TOML; ConfigurationError names file, key, what was got and what is allowed."""
    return load_toml(path, PioneerWorld)
