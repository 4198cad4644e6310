"""The proximity sensors: five on the front rim, each the nearest thing within its narrow cone, 10 cm far."""

import numpy as np
from numpy.typing import NDArray

from agents.robots.simulated.world import World
from llrp_online.configuration.running import Simulation

Floats = NDArray[np.float64]

RAYS = 3  # a cone is felt by this many rays: with 6 degrees between them, a 1 cm pole cannot hide at 10 cm
MARGIN_SIGMAS = 4  # noise may bring what stands this many deviations beyond the reach within it


class Proximity:
    """Ranges as a LaserScan has them: index 0 is the rightmost sensor, +inf where nothing is within reach."""

    def __init__(self, world: World, simulation: Simulation, rng: np.random.Generator) -> None:
        self._world, self._rng = world, rng
        self._angles = np.deg2rad(simulation.beams_deg)
        half = np.deg2rad(simulation.beam_width_deg) / 2
        self._cone = np.linspace(-half, half, RAYS) if half else np.zeros(1)
        self._radius_m, self._centre_ahead_m = simulation.radius_m, simulation.centre_ahead_m
        self._height_m = simulation.beam_height_m
        self._reach_m, self._noise_m = simulation.range_m, simulation.range_noise_m

    def ranges(self, pose: Floats) -> Floats:
        """(S,) float64 [m] from a robot at `pose`, right to left."""
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        centre = pose[:2] + self._centre_ahead_m * np.array([cos, sin])
        true_m = np.array([self._nearest_m(centre, pose[2] + angle) for angle in self._angles])
        noisy_m = np.maximum(true_m + self._noise_m * self._rng.standard_normal(len(true_m)), 0.0)
        return np.where(noisy_m <= self._reach_m, noisy_m, np.inf)

    def _nearest_m(self, centre: Floats, angle_rad: float) -> float:
        look = np.array([np.cos(angle_rad), np.sin(angle_rad)])
        origin = np.array([*(centre + self._radius_m * look), self._height_m])
        rays = np.stack([np.cos(angle_rad + self._cone), np.sin(angle_rad + self._cone), 0 * self._cone], -1)
        cutoff_m = self._reach_m + MARGIN_SIGMAS * self._noise_m
        distance_m, geom, _ = self._world.cast(origin, rays, cutoff_m)
        return float(distance_m[geom >= 0].min(initial=np.inf))
