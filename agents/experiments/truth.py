"""What a label ought to be: the sensors of the simulated robot, put where it truly would have stood at the target.

True poses are in no recording, for no robot knows them. A drive without a camera is the same drive, so they come from
driving it once more, in a second.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agents.behaviours import controller
from agents.experiments.drives import Drive
from agents.robots.simulated.layout import Footprints, Layout
from agents.robots.simulated.proximity import Proximity
from agents.robots.simulated.scenario import Scenario
from agents.robots.simulated.world import World
from agents.rollout import RangeBits, rollout
from agents.simulated_drive import simulated_robot
from llrp_online.configuration import RobotConfiguration
from replay.poses import Floats, compose
from replay.resolution import Drive as Arrays

#: No robot stands here: no reading can have been taken, so a label of either kind is wrong.
NOWHERE = -1


@dataclass(frozen=True, eq=False)
class Known:
    """A drive with what its robot did not know.

    Attributes:
        arrays: what it sensed.
        frames: (F, 3) float64 true pose of each frame, in the arena.
        layout: of the arena.
    """

    arrays: Arrays
    frames: Floats
    layout: Layout


def driven(drive: Drive) -> Known:
    """Drive once more, without a camera."""
    form, arena = RobotConfiguration.model_validate(drive.configuration), Scenario.model_validate(drive.scenario)
    robot = simulated_robot(form, arena, drive.seed, camera=False)
    seen = list(rollout(robot, controller(drive.behaviour, form, drive.seed), form, 60 * drive.minutes))
    bits_of = RangeBits(form.short_range)
    t_ns = np.array([one.t_ns for one in seen], np.int64)
    pictured = slice(None, None, form.simulated().camera_divider)
    arrays = Arrays(
        t_ns,
        np.array([one.odometry for one in seen]),
        np.array([one.covariance for one in seen]) if form.odometry.trust_covariance else None,
        t_ns,
        np.zeros(len(seen), np.int64),
        np.array([bits_of(one.ranges) for one in seen]),
        t_ns[pictured],
    )
    return Known(arrays, np.array([one.true_pose for one in seen[pictured]]), robot.layout)


class Truth:
    """Casts the rays of a robot put somewhere: the same rays, origins and thresholds as it drives with, without noise.

    A pose beyond the walls, or in which the body would overlap an obstacle by more than the label rule's position
    tolerance, is `NOWHERE`: even a reading a whole tolerance away could not have been taken. Where it overlaps by less,
    a sensor whose place on the rim lies inside the obstacle feels it.

    Args:
        configuration: the robot's, with [simulation].
        layout: of the arena.
    """

    def __init__(self, configuration: RobotConfiguration, layout: Layout) -> None:
        simulation = configuration.simulated()
        self._bits_of = RangeBits(configuration.short_range)
        self._targets = configuration.targets.build().poses
        self._sensors = len(configuration.sensors)
        self._tolerance_m = configuration.labels.position_tolerance_m
        self._radius_m, self._centre_ahead_m = simulation.radius_m, simulation.centre_ahead_m
        self._half_m = np.array([layout.scenario.arena.length_m, layout.scenario.arena.width_m]) / 2
        self._footprints = Footprints(layout.shapes)
        self._proximity = Proximity(World(layout), simulation, np.random.default_rng(0))

    def bits(self, pose: Floats) -> NDArray[np.int8]:
        """What is felt at a pose (3,) of the arena: (S,) int8, 1 or 0, or all `NOWHERE`."""
        x, y, yaw = pose.tolist()
        centre = np.array([x + self._centre_ahead_m * np.cos(yaw), y + self._centre_ahead_m * np.sin(yaw)])
        clear_m = self._footprints.clearance_m(centre) - self._radius_m
        if clear_m < -self._tolerance_m or (np.abs(centre) > self._half_m).any():
            return np.full(self._sensors, NOWHERE, np.int8)
        ranges = self._proximity.true_ranges(pose)
        if clear_m < 0:
            inside = [self._footprints.clearance_m(place) < 0 for place in self._proximity.places_m(pose)]
            ranges[inside] = 0.0
        return self._bits_of(ranges)

    def labels(self, frames: Floats) -> NDArray[np.int8]:
        """What is felt at every target of frames truly taken at (F, 3): (F, T, S) int8, 1, 0 or `NOWHERE`."""
        poses = compose(frames[:, None], self._targets)
        felt = [self.bits(pose) for pose in poses.reshape(-1, 3)]
        return np.array(felt, np.int8).reshape(*poses.shape[:2], self._sensors)
