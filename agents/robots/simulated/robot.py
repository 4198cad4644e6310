"""The simulated Mighty Thymio: body, proximity sensors and camera in one arena, advanced tick by tick.

It has no clock and no thread: a tick takes as long as it takes, and its time is counted, so the same seed and the same
commands give the same observations, bit for bit, live or as fast as the machine can.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agents.robots.simulated.body import Body
from agents.robots.simulated.camera import Camera
from agents.robots.simulated.layout import Footprints, Layout
from agents.robots.simulated.people import People
from agents.robots.simulated.proximity import Proximity
from agents.robots.simulated.scenario import Scenario
from agents.robots.simulated.world import World
from llrp_online.configuration.running import Simulation

Floats = NDArray[np.float64]

START_NS = 1_000_000_000  # time zero is what a message with an unset stamp says


@dataclass(frozen=True, eq=False)
class Observation:
    """Everything one tick gives.

    Attributes:
        t_ns: sensor time of all of it.
        odometry: (3,) float64 [x_m, y_m, yaw_rad], since the start.
        covariance: (3, 3) float64 of it, accumulated.
        twist: (2,) float64 [m/s, rad/s], as the encoders saw it.
        ranges: (S,) float64 [m] as a LaserScan has them: rightmost first, +inf where nothing is within reach.
        picture: (height, width, 3) uint8 RGB, or None on ticks without one.
        true_pose: (3,) float64 in the arena; for evaluation alone, no robot knows it.
        collided: something stopped the body in this tick.
    """

    t_ns: int
    odometry: Floats
    covariance: Floats
    twist: Floats
    ranges: Floats
    picture: NDArray[np.uint8] | None
    true_pose: Floats
    collided: bool


class SimulatedRobot:
    """A Thymio in one layout of a scenario.

    `picture` is the camera's (height, width), or None for a robot without one, which is many times faster.

    >>> from agents.robots.simulated import Scenario, SimulatedRobot
    >>> grey = {"name": "grey", "pattern": "plain", "colours": ["#777777", "#999999"], "period_m": 1.0}
    >>> scenario = Scenario.model_validate({
    ...     "arena": {"length_m": 2.0, "width_m": 2.0, "floor": "grey", "wall": "grey"},
    ...     "light": {"azimuth_deg": 30, "elevation_deg": 50, "distance_m": 3, "strength": 0.7, "ambient": 0.4},
    ...     "surface": [grey],
    ...     "obstacles": [{"kind": "ball", "count": 3, "width_m": [0.08, 0.12], "surfaces": ["grey"]}],
    ... })
    >>> robot = SimulatedRobot(Simulation(), scenario, seed=0, picture=(64, 80))
    >>> robot.step(0.1, 0.0).picture.shape
    (64, 80, 3)
    """

    def __init__(self, simulation: Simulation, scenario: Scenario, seed: int, picture: tuple[int, int] | None) -> None:
        layout = Layout.draw(scenario, seed)
        self._people = People(scenario, layout, seed)
        self._world = World(layout, self._people.shapes)
        self._footprints = Footprints(layout.shapes, self._people.shapes)
        # One generator each, so that a robot without a camera or with other sensors drives the same way.
        wheels, sensors = np.random.default_rng([seed, 2]), np.random.default_rng([seed, 3])
        self._body = Body(simulation, self._footprints, layout.start, wheels)
        self._proximity = Proximity(self._world, simulation, sensors)
        self._camera = None if picture is None else Camera(self._world, scenario.light, simulation, *picture)
        self._rate_hz, self._camera_divider = simulation.rate_hz, simulation.camera_divider
        self._ticks = 0
        self.layout = layout

    @property
    def collisions(self) -> int:
        """How often the body ran into something: once for each contact, however long it lasted."""
        return self._body.collisions

    def step(self, speed_m_s: float, turn_rad_s: float) -> Observation:
        """Others walk for one tick, the robot drives, then it looks around. The first tick has a picture."""
        body = self._body
        if self._footprints.moving:
            self._walk()
        before = body.true_pose
        body.step(speed_m_s, turn_rad_s, 1 / self._rate_hz)
        with_picture = self._camera is not None and self._ticks % self._camera_divider == 0
        self._ticks += 1
        return Observation(
            t_ns=START_NS + round(self._ticks * 1e9 / self._rate_hz),
            odometry=body.odometry,
            covariance=body.covariance,
            twist=body.twist,
            ranges=self._proximity.ranges(body.true_pose),
            picture=self._camera.picture(body.true_pose, before) if self._camera and with_picture else None,
            true_pose=body.true_pose,
            collided=body.blocked,
        )

    def _walk(self) -> None:
        self._people.step(self._body.disc, 1 / self._rate_hz)
        self._world.move(self._people.legs_m)
        self._footprints.move(self._people.legs_m)
