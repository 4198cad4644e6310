"""What the sensors would feel at places where the robot is not: the truth that labels and predictions are held to."""

import numpy as np
from numpy.typing import NDArray

from agents.robots.simulated.layout import Layout
from agents.robots.simulated.proximity import Proximity
from agents.robots.simulated.scenario import Scenario
from agents.robots.simulated.world import World
from llrp_online.configuration.running import Simulation
from replay.poses import compose

Floats = NDArray[np.float64]


class Truth:
    """The proximity sensors without their noise, anywhere in one layout; for evaluation alone, no robot knows it.

    A place where the body would stand inside an obstacle counts like any other: the sensors look outwards from their
    places on its rim, and a ray that begins inside a solid meets that solid's far side.

    Args:
        simulation: the robot's.
        scenario: the arena's.
        seed: of the layout.
    """

    def __init__(self, simulation: Simulation, scenario: Scenario, seed: int) -> None:
        silent = simulation.model_copy(update={"range_noise_m": 0.0})
        self._proximity = Proximity(World(Layout.draw(scenario, seed)), silent, np.random.default_rng(0))

    def ranges(self, pose: Floats, targets: Floats) -> Floats:
        """(T, S) float64 [m], right to left, inf beyond reach: what would be felt at each target of a robot at `pose`.

        Args:
            pose: (3,) true pose [x_m, y_m, yaw_rad].
            targets: (T, 3) in the robot's frame.
        """
        return np.stack([self._proximity.ranges(place) for place in compose(pose, targets)])
