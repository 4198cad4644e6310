"""The whole simulated robot: its time, its determinism, and what it meets in the ten scenarios."""

import hashlib
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from agents.controllers.explore import Explore
from agents.extras import install
from agents.robots.simulated import SimulatedRobot, load_scenario
from agents.rollout import RangeBits, rollout
from llrp_online.configuration import load

CONFIGURATION = load("configs/thymio.toml")
SCENARIOS = sorted(Path("configs/scenarios").glob("*.toml"))
TILES = load_scenario("configs/scenarios/tiles.toml")
PICTURE = CONFIGURATION.picture_shape[:2]


def robot(scenario=TILES, seed=0, picture=PICTURE):
    return SimulatedRobot(CONFIGURATION.simulation, scenario, seed, picture)


def digest(observations):
    """Every byte that was observed."""
    sha = hashlib.sha256()
    for one in observations:
        sha.update(one.t_ns.to_bytes(8, "little"))
        for array in (one.odometry, one.covariance, one.twist, one.ranges, one.true_pose, one.picture):
            sha.update(b"" if array is None else array.tobytes())
    return sha.hexdigest()


def explored(seed, seconds, picture=PICTURE, scenario=TILES):
    explore = Explore(CONFIGURATION.control, seed)
    return list(rollout(robot(scenario, seed, picture), explore, CONFIGURATION, seconds))


def test_the_same_seed_gives_the_same_bytes_and_another_seed_others():
    assert digest(explored(0, 10)) == digest(explored(0, 10))
    assert digest(explored(0, 10)) != digest(explored(1, 10))


def test_without_a_camera_it_drives_the_same_way():
    seen, blind = explored(0, 10), explored(0, 10, picture=None)
    assert all(one.picture is None for one in blind)
    assert all((one.ranges == other.ranges).all() for one, other in zip(seen, blind, strict=True))
    assert (seen[-1].true_pose == blind[-1].true_pose).all()


def test_time_advances_by_one_tick_and_pictures_come_at_their_rate():
    observations = explored(0, 2)
    times = np.array([one.t_ns for one in observations])
    assert times[0] >= 1_000_000_000
    assert set(np.diff(times)) == {50_000_000}
    assert [one.picture is not None for one in observations[:4]] == [True, False, True, False]


def test_an_observation_has_the_shapes_it_promises():
    seen = robot().step(0.1, 0.2)
    assert (seen.odometry.shape, seen.covariance.shape, seen.twist.shape) == ((3,), (3, 3), (2,))
    assert seen.ranges.shape == (5,)
    assert seen.picture is not None
    assert (seen.picture.shape, seen.picture.dtype) == ((64, 80, 3), np.uint8)
    assert np.linalg.eigvalsh(seen.covariance).min() > -1e-18


def test_what_was_observed_is_never_changed_afterwards():
    one = robot()
    first = one.step(0.1, 0.0)
    before = digest([first])
    for _ in range(5):
        one.step(0.1, 1.0)
    assert digest([first]) == before


def test_a_wall_is_met_sooner_or_later_and_counted_once():
    one = robot(seed=2, picture=None)
    seen = [one.step(0.2, 0.0) for _ in range(400)]
    assert one.collisions == 1
    assert seen[-1].collided
    assert not seen[0].collided


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_every_scenario_can_be_seen(path):
    pictures = [one.picture for one in explored(0, 3, scenario=load_scenario(path)) if one.picture is not None]
    pixels = np.concatenate([picture.reshape(-1, 3) for picture in pictures]).astype(float)
    assert 20 < pixels.mean() < 230  # neither night nor glare
    assert pixels.std() > 3
    assert (pixels == 255).all(-1).mean() < 0.1


def test_floors_look_different():
    colours = []
    for path in SCENARIOS:
        picture = robot(load_scenario(path)).step(0.0, 0.0).picture
        assert picture is not None
        colours.append([*picture[32:].mean((0, 1)), *picture[32:].std((0, 1))])
    apart = np.linalg.norm(np.array(colours)[:, None] - np.array(colours)[None], axis=-1)
    assert apart[~np.eye(len(SCENARIOS), dtype=bool)].min() > 8


def test_without_mujoco_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)  # Python's own way to make an import fail
    with pytest.raises(ImportError, match=re.escape(install("sim"))):
        robot()


def positives(scenario, seed, minutes):
    bits_of = RangeBits(CONFIGURATION.short_range)
    return np.mean([bits_of(one.ranges) == 1 for one in explored(seed, 60 * minutes, None, scenario)], 0)


def test_exploring_soon_meets_something():
    assert positives(TILES, 0, minutes=1).max() > 0.01


@pytest.mark.slow
@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_exploring_makes_three_in_a_hundred_readings_of_each_sensor_positive(path):
    assert positives(load_scenario(path), seed=0, minutes=10).min() >= 0.03
