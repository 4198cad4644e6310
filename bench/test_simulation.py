"""The simulated world: frames a second, beside MuJoCo's rays."""

import time
from pathlib import Path

import numpy as np
import pytest

from agents.robots.simulated import SimulatedRobot, load_scenario
from agents.robots.simulated.camera import Camera
from agents.robots.simulated.layout import Layout
from agents.robots.simulated.world import World
from bench.rows import Figure, Growth
from llrp_online.configuration.running import Simulation
from replay.compiling import plainly

SCENARIO = load_scenario(Path("configs/scenarios/tiles.toml"))
SIZE = (64, 80)
RNG = np.random.default_rng(0)


def test_frames_a_second(race, short):
    ticks = 40 if short else 200
    robot = SimulatedRobot(Simulation(camera_divider=1), SCENARIO, 0, SIZE)
    reference = SimulatedRobot(Simulation(camera_divider=1), SCENARIO, 0, SIZE)
    texels = np.zeros((SIZE[0] * SIZE[1], 3), np.uint8)
    places = RNG.permutation(len(texels))

    def live() -> None:
        for tick in range(ticks):
            robot.step(0.12, np.sin(tick / 20))

    def live_by_mujoco() -> None:
        with plainly():
            for tick in range(ticks):
                reference.step(0.12, np.sin(tick / 20))

    def look_up() -> None:
        for _ in range(ticks):
            texels[places]

    race(
        "simulated world, one tick with a picture of 80 x 64: body, five proximity sensors, camera, shadows",
        live,
        {"MuJoCo rays and numpy": live_by_mujoco},
        {"MuJoCo rays and numpy": 2.0},
        limit=("one texel looked up a pixel (numpy)", look_up),
        per=ticks,
        note=f"the same bytes as the peer (tests/agents/test_simulated_kernels.py); {len(robot.layout.shapes)} shapes",
    )


@pytest.mark.parametrize(
    ("quantity", "sizes", "most"), [("pixels", (1, 10), 1.05), ("shapes", (1, 10), 1.0)], ids=["pixels", "shapes"]
)
def test_growth_of_a_picture(record, short, quantity, sizes, most):
    found = []
    for times in sizes:
        scale = times**0.5 if quantity == "pixels" else 1.0
        layout = Layout.draw(SCENARIO, 0)
        some = layout.shapes * (times if quantity == "shapes" else 1)
        world = World(Layout(SCENARIO, some, layout.start))
        camera = Camera(world, SCENARIO.light, Simulation(), round(SIZE[0] * scale), round(SIZE[1] * scale))
        found.append(Figure([seconds(camera, 10 if short else 50) for _ in range(5)]))
    record(Growth("simulated picture", quantity, sizes, found, most))


def seconds(camera: Camera, pictures: int) -> float:
    """One picture's, from places all over the arena."""
    poses = np.column_stack([RNG.uniform(-0.9, 0.9, (pictures, 2)), RNG.uniform(-np.pi, np.pi, pictures)])
    start = time.perf_counter()
    for pose in poses:
        camera.picture(pose)
    return (time.perf_counter() - start) / pictures


def test_a_run_costs_the_same_late_as_early(record, short):
    robot = SimulatedRobot(Simulation(camera_divider=1), SCENARIO, 0, SIZE)
    lengths, found = (100, 400) if short else (1_000, 10_000), []
    lived = 0
    for length in lengths:
        times = []
        while lived < length:
            start = time.perf_counter()
            robot.step(0.12, np.sin(lived / 20))
            times.append(time.perf_counter() - start)
            lived += 1
        found.append(Figure(times[-min(len(times), 1_000) :]))
    record(Growth("simulated tick", "ticks lived before", lengths, found, 0.05))
