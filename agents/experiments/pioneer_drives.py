"""Drives of the simulated Pioneer that trials share: arrays on disk, as 250,000 JPEGs would only cost time.

A drive of seven minutes is 129 MB: a grey picture for each camera, 20 times a second. Its labels are resolved once.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from agents.experiments.shared import digest, made_once
from agents.robots.pioneer import Eyes, Floor, PioneerWorld, drive
from llrp_online.configuration import RobotConfiguration
from replay import resolution

#: Colours of a picture of the network's: the floor is grey, so all three are alike.
_COLOURS = 3


@dataclass(frozen=True, eq=False)
class Recorded:
    """A drive as it was sensed; all arrays in order of time, as long as each other.

    Attributes:
        t_ns: (N,) int64.
        poses: (N, 3) float64 [x_m, y_m, yaw_rad] as odometry has them, without noise; a jump begins a trajectory.
        trajectory: (N,) int64, counting up from 0.
        grey: (N,) float64, what the floor sensor read, 0 black to 1 white.
        greys: (N, H, W, cameras) uint8.
        labels: (N, targets, 1) int8: 1 dark, 0 bright, -1 unknown.
    """

    t_ns: NDArray[np.int64]
    poses: NDArray[np.float64]
    trajectory: NDArray[np.int64]
    grey: NDArray[np.float64]
    greys: NDArray[np.uint8]
    labels: NDArray[np.int8]

    @classmethod
    def load(cls, folder: Path) -> Self:
        """From `PioneerDrive.recorded`; the pictures stay on disk until they are looked at."""
        arrays = {name: np.load(folder / f"{name}.npy") for name in cls.__annotations__ if name != "greys"}
        return cls(**arrays, greys=np.asarray(np.load(folder / "greys.npy", mmap_mode="r")))

    def pictures(self, rows: NDArray[np.int64]) -> NDArray[np.uint8]:
        """(R, H, W, 3 * cameras) uint8, as the network takes them."""
        return in_colour(self.greys[rows])


def in_colour(greys: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(..., cameras) grey pictures -> (..., 3 * cameras), RGB of each camera in turn."""
    return np.repeat(greys, _COLOURS, axis=-1)


@dataclass(frozen=True)
class PioneerDrive:
    """A drive in virtual time over one map, wholly told by plain values.

    Attributes:
        configuration: the robot's: picture size, threshold, targets and label rule, as JSON values.
        world: see `PioneerWorld`, as JSON values.
        seed: of the map and of the drive.
        minutes: of the robot's time.
    """

    configuration: Mapping[str, Any]
    world: Mapping[str, Any]
    seed: int
    minutes: float

    def as_json(self) -> dict[str, Any]:
        """For a trial's parameters."""
        return asdict(self)

    def recorded(self, folder: Path) -> Recorded:
        """The drive, from the folder that trials share, or driven now."""
        return Recorded.load(made_once(folder / f"pioneer-{digest(self.as_json())}", self._record))

    def _record(self, part: Path) -> None:
        form, world = RobotConfiguration.model_validate(self.configuration), PioneerWorld.model_validate(self.world)
        height, width, _ = form.picture_shape
        floor = Floor(world.floor, self.seed)
        eyes = Eyes(floor, world, height, width)
        steps = list(drive(world.drive, floor.half_m, 60 * self.minutes, self.seed))
        t_ns, poses = np.array([step.t_ns for step in steps]), np.array([step.pose for step in steps])
        grey = np.array([floor.mean_grey(x_m, y_m, world.sensor.side_m) for x_m, y_m, _ in poses.tolist()])
        part.mkdir()
        shape = (len(steps), height, width, len(world.camera))
        pictures = np.lib.format.open_memmap(part / "greys.npy", "w+", np.uint8, shape)
        for row, pose in enumerate(poses):
            pictures[row] = eyes.picture(pose)
        pictures.flush()
        arrays = {"t_ns": t_ns, "poses": poses, "trajectory": np.array([step.trajectory for step in steps])}
        arrays |= {"grey": grey, "labels": labels_of(form, t_ns, poses, bits_of(form, grey))}
        for name, array in arrays.items():
            np.save(part / f"{name}.npy", array)


def bits_of(form: RobotConfiguration, grey: NDArray[np.float64]) -> NDArray[np.int8]:
    """(N, 1) bits of the configuration's only sensor, from (N,) readings."""
    (sensor,) = form.short_range
    below, above = (np.nan if limit is None else limit for limit in (sensor.below, sensor.above))
    return ((grey < below) | (grey > above)).astype(np.int8)[:, None]


def labels_of(
    form: RobotConfiguration, t_ns: NDArray[np.int64], poses: NDArray[np.float64], bits: NDArray[np.int8]
) -> NDArray[np.int8]:
    """(N, targets, 1) labels of frames taken with the readings, at one rate."""
    moments = resolution.Drive(t_ns, poses, None, t_ns, np.zeros(len(t_ns), np.int64), bits, t_ns)
    rule, limits = form.labels.rule(), form.odometry.limits()
    return resolution.resolve(moments, form.targets.build(), [[0]], rule, limits).labels
