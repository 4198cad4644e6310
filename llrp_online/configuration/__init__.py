"""A robot's configuration: TOML read into one frozen value, checked as a whole.

>>> from llrp_online.configuration import RobotConfiguration, load
>>> RobotConfiguration.model_fields["labels"].annotation.__name__
'Labels'
"""

from pathlib import Path
from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from llrp_online.configuration.learning import Augmentation, Calibrating, Compute, Memory, Network, Publishing, Training
from llrp_online.configuration.load import ConfigurationError, load_toml, validate
from llrp_online.configuration.rig import (
    Camera,
    GridTargets,
    Labels,
    LineTargets,
    ListTargets,
    Odometry,
    Robot,
    ShortRange,
    Table,
)
from llrp_online.configuration.running import Control, Keys, Simulation, Transport
from llrp_online.configuration.thymio import Thymio
from llrp_online.mirror import Mirror

__all__ = ["ConfigurationError", "RobotConfiguration", "Table", "Thymio", "load", "load_toml", "validate"]


class RobotConfiguration(Table):
    """The whole of a robot's TOML."""

    robot: Robot
    camera: list[Camera] = Field(min_length=1)
    odometry: Odometry = Odometry()
    short_range: list[ShortRange] = Field(min_length=1)
    targets: Annotated[LineTargets | GridTargets | ListTargets, Field(discriminator="kind")]
    labels: Labels
    memory: Memory = Memory()
    network: Network = Network()
    augmentation: Augmentation = Augmentation()
    training: Training = Training()
    publishing: Publishing = Publishing()
    calibration: Calibrating = Calibrating()
    compute: Compute = Compute()
    transport: Transport = Transport()
    control: Control = Control()
    simulation: Simulation | None = None
    # Left out where a configuration is written down: no result depends on how the robot is reached, and studies and
    # checkpoints know theirs by what is written.
    keys: Keys = Field(default=Keys(), exclude=True)
    thymio: Thymio = Field(default=Thymio(), exclude=True)

    @property
    def sensors(self) -> list[str]:
        """Names of the short-range sensors, left to right."""
        return [sensor.name for sensor in self.short_range]

    @property
    def range_topics(self) -> list[str]:
        """Topics the short-range readings come in, each once, in order of first mention."""
        return list(dict.fromkeys(sensor.topic for sensor in self.short_range))

    @property
    def event_topics(self) -> list[str]:
        """Range topics whose fields are all `latest`: their silence says that nothing has changed."""
        return [
            topic
            for topic in self.range_topics
            if all(sensor.way().latest for sensor in self.short_range if sensor.topic == topic)
        ]

    @property
    def streams(self) -> dict[str, list[int]]:
        """Each range topic with the sensors it speaks for, by their index."""
        return {
            topic: [index for index, sensor in enumerate(self.short_range) if sensor.topic == topic]
            for topic in self.range_topics
        }

    @property
    def picture_shape(self) -> tuple[int, int, int]:
        """(height, width, channels) of what the network sees: the cameras' RGB stacked along the channels."""
        return self.camera[0].height, self.camera[0].width, 3 * len(self.camera)

    @property
    def outputs(self) -> tuple[int, int]:
        """(targets, sensors): the shape of a frame's labels and of its prediction."""
        return len(self.targets.build()), len(self.sensors)

    def simulated(self) -> Simulation:
        """Its [simulation]; ValueError if the robot has none."""
        if self.simulation is None:
            raise ValueError(f"robot {self.robot.name!r}: its configuration has no [simulation] table; add one")
        return self.simulation

    def camera_swap(self) -> NDArray[np.int64] | None:
        """Which camera replaces each in a flipped world; None if the rig has no mirror image."""
        return _swap([c.topic for c in self.camera], [c.swap for c in self.camera], alone=len(self.camera) == 1)

    def sensor_swap(self) -> NDArray[np.int64] | None:
        """Which sensor replaces each in a flipped world; None if the rig has no mirror image."""
        return _swap(self.sensors, [s.swap for s in self.short_range], alone=len(self.short_range) == 1)

    def mirror(self) -> Mirror | None:
        """The rig's mirror image; None if it has none."""
        targets, sensors, cameras = self.targets.build().mirror(), self.sensor_swap(), self.camera_swap()
        if targets is None or sensors is None or cameras is None:
            return None
        return Mirror(targets, sensors, cameras)

    @property
    def averaged_with(self) -> Mirror | None:
        """The mirror image whose prediction is averaged with each picture's own; None where that is off.

        A network that was never shown a flipped picture has nothing to say of one.
        """
        return self.mirror() if self.network.mirrored and self.augmentation.flip > 0 else None

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        for what, names in (("camera topic", [c.topic for c in self.camera]), ("short_range name", self.sensors)):
            if twice := sorted({name for name in names if names.count(name) > 1}):
                raise ValueError(f"{what}: each must be given once, got {twice} more than once")
        if len(sizes := {(c.width, c.height) for c in self.camera}) > 1:
            raise ValueError(f"camera: all must share one width and height, got {sorted(sizes)}")
        for what, names, swaps in (
            ("camera", [c.topic for c in self.camera], [c.swap for c in self.camera]),
            ("short_range", self.sensors, [s.swap for s in self.short_range]),
        ):
            _check_swaps(what, names, swaps)
        for topic, sensors in self.streams.items():
            if len({self.short_range[index].way().latest for index in sensors}) > 1:
                raise ValueError(f"short_range: of topic {topic!r}, either every field is `latest` or none is")
        self.targets.build()  # targets that cannot be built are refused here, where the file is named
        if self.augmentation.flip > 0:
            self._can_flip()
        return self

    def _can_flip(self) -> None:
        mirrored = {
            "camera": (self.camera_swap(), "give every [[camera]] its `swap`"),
            "short_range": (self.sensor_swap(), "give every [[short_range]] its `swap` (itself, if it looks ahead)"),
            "targets": (self.targets.build().mirror(), "give targets that mirror onto each other (y to -y)"),
        }
        for what, (swap, mend) in mirrored.items():
            if swap is None:
                raise ValueError(
                    f"augmentation.flip = {self.augmentation.flip:g}, but {what} has no mirror image: "
                    f"{mend}, or set flip = 0"
                )


def load(path: str | Path) -> RobotConfiguration:
    """Read a robot's TOML; ConfigurationError names file, key, what was got and what is allowed."""
    return load_toml(path, RobotConfiguration)


def _check_swaps(what: str, names: list[str], swaps: list[str | None]) -> None:
    partner = dict(zip(names, swaps, strict=True))
    for name, other in partner.items():
        if other is None:
            continue
        if other not in partner:
            raise ValueError(f"{what} {name!r}: swap = {other!r} names none of {names}")
        if partner[other] != name:
            raise ValueError(
                f"{what} {name!r}: swap = {other!r}, but {other!r} has swap = {partner[other]!r}; make them agree"
            )


def _swap(names: list[str], swaps: list[str | None], *, alone: bool) -> NDArray[np.int64] | None:
    if alone:
        return np.zeros(1, np.int64)
    if any(swap is None for swap in swaps):
        return None
    return np.array([names.index(swap) for swap in swaps if swap is not None], np.int64)
