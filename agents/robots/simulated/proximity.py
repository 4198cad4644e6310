"""The proximity sensors: five on the front rim, each the nearest thing within its narrow cone, 10 cm far."""

import math

import numpy as np
from numpy.typing import NDArray

from agents.robots.simulated.world import World, turned
from llrp_online.configuration.running import Simulation
from replay.compiling import Compiled

Floats = NDArray[np.float64]

RAYS = 3  # a cone is felt by this many rays: with 6 degrees between them, a 1 cm pole cannot hide at 10 cm
MARGIN_SIGMAS = 4  # noise may bring what stands this many deviations beyond the reach within it


class Proximity:
    """Ranges as a LaserScan has them: index 0 is the rightmost sensor, +inf where nothing is within reach."""

    def __init__(self, world: World, simulation: Simulation, rng: np.random.Generator) -> None:
        self._world, self._rng = world, rng
        angles = np.deg2rad(simulation.beams_deg)
        half = np.deg2rad(simulation.beam_width_deg) / 2
        cone = angles[:, None] + (np.linspace(-half, half, RAYS) if half else np.zeros(1))
        # In the robot's frame: (S, 3) where the sensors are, and (S, RAYS, 3) where they look. All is level.
        ahead_m = simulation.centre_ahead_m + simulation.radius_m * np.cos(angles)
        left_m, height_m = simulation.radius_m * np.sin(angles), np.full(len(angles), simulation.beam_height_m)
        self._origins_m = np.stack([ahead_m, left_m, height_m], -1)
        self._rays = np.stack([np.cos(cone), np.sin(cone), np.zeros_like(cone)], -1)
        self._reach_m, self._noise_m = simulation.range_m, simulation.range_noise_m
        self._cutoff_m = self._reach_m + MARGIN_SIGMAS * self._noise_m
        self._kernels = Compiled("agents.robots.simulated.kernels")

    def ranges(self, pose: Floats) -> Floats:
        """(S,) float64 [m] from a robot at `pose`, right to left."""
        true_m = self._nearest(pose)
        noisy_m = np.maximum(true_m + self._noise_m * self._rng.standard_normal(len(true_m)), 0.0)
        return np.where(noisy_m <= self._reach_m, noisy_m, np.inf)

    def true_ranges(self, pose: Floats) -> Floats:
        """(S,) float64 [m], as `ranges` without noise; draws nothing from its random numbers."""
        true_m = self._nearest(pose)
        return np.where(true_m <= self._reach_m, true_m, np.inf)

    def places_m(self, pose: Floats) -> Floats:
        """(S, 2) float64 [m]: where the sensors of a robot at `pose` are in the arena, right to left."""
        x, y, yaw = pose.tolist()
        return np.array([x, y]) + turned(self._origins_m, math.cos(yaw), math.sin(yaw))[:, :2]

    def _nearest(self, pose: Floats) -> Floats:
        """(S,) float64 [m] to the nearest thing within the cutoff, inf where there is none."""
        x, y, yaw = pose.tolist()
        position = x, y, math.cos(yaw), math.sin(yaw)
        true_m = np.empty(len(self._rays))
        kernels = self._kernels.get()
        if kernels is None:
            self._follow(*position, true_m)
        else:
            kernels.nearest(position, self._origins_m, self._rays, self._world.solids, self._cutoff_m, true_m)
        return true_m

    def _follow(self, x_m: float, y_m: float, cos: float, sin: float, true_m: Floats) -> None:
        """What each sensor would feel without noise, ray by ray: the reference."""
        origins_m = np.array([x_m, y_m, 0.0]) + turned(self._origins_m, cos, sin)
        rays = turned(self._rays, cos, sin)
        for sensor, origin_m in enumerate(origins_m):
            true_m[sensor] = self._world.cast(origin_m, rays[sensor], self._cutoff_m)[0].min()
