"""Scenarios and the layouts drawn from them."""

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from agents.robots.simulated import load_scenario
from agents.robots.simulated.layout import Footprints, Layout, Shape
from agents.robots.simulated.scenario import Obstacles, Surface
from agents.robots.simulated.textures import PATTERNS, texture
from llrp_online.configuration import ConfigurationError

SCENARIOS = sorted(Path("configs/scenarios").glob("*.toml"))
GREY = Surface(name="grey", pattern="plain", colours=("#808080", "#909090"), period_m=1.0)


def test_there_are_ten_scenarios_with_ten_floors():
    scenarios = [load_scenario(path) for path in SCENARIOS]
    floors = {scenario.surface_named(scenario.arena.floor) for scenario in scenarios}
    assert len(scenarios) == len(floors) == 10


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_every_seed_gives_another_layout_with_room_to_start(path):
    scenario = load_scenario(path)
    layouts = [Layout.draw(scenario, seed) for seed in range(20)]
    assert len({layout.start for layout in layouts}) == 20
    for layout in layouts:
        assert Footprints(layout.shapes).clearance_m(layout.start[:2]) > 0.1


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_some_obstacles_wear_the_colour_of_the_floor(path):
    scenario = load_scenario(path)
    assert any(scenario.arena.floor in group.surfaces for group in scenario.obstacles)


def test_same_seed_gives_the_same_layout():
    scenario = load_scenario("configs/scenarios/wood.toml")
    assert Layout.draw(scenario, 3) == Layout.draw(scenario, 3)


def test_obstacles_keep_their_distance_and_stay_inside():
    scenario = load_scenario("configs/scenarios/grass.toml")  # no chairs: every shape is an obstacle of its own
    walls, obstacles = (Layout.draw(scenario, 0).shapes[part] for part in (slice(4), slice(4, None)))
    for one, other in combinations(obstacles, 2):
        reach = one.half_m[0] if one.kind != "box" else 0.0
        assert Footprints([other]).clearance_m(one.centre_m[:2]) - reach >= scenario.arena.gap_m
    for one in obstacles:
        assert Footprints(walls).clearance_m(one.centre_m[:2]) > scenario.arena.gap_m


def test_a_turned_box_has_its_clearance_along_its_own_axes():
    box = Shape("box", (1.0, 0.0, 0.1), (0.2, 0.1, 0.1), GREY, yaw_rad=np.pi / 2)
    footprint = Footprints([box])
    assert footprint.clearance_m([0.0, 0.0]) == pytest.approx(0.9)
    assert footprint.clearance_m([1.0, 0.5]) == pytest.approx(0.3)
    assert footprint.clearance_m([1.1 + 0.03, 0.2 + 0.04]) == pytest.approx(0.05)
    assert footprint.clearance_m([1.0, 0.0]) == pytest.approx(-0.1)


def test_what_is_passed_under_has_no_footprint():
    seat = Shape("box", (0.0, 0.0, 0.3), (0.2, 0.2, 0.01), GREY, blocks=False)
    assert Footprints([seat]).clearance_m([0.0, 0.0]) == np.inf


def test_too_many_obstacles_are_refused_with_a_way_out():
    scenario = load_scenario("configs/scenarios/tiles.toml")
    crowd = Obstacles(kind="box", count=99, width_m=(0.2, 0.3), surfaces=["carton"])
    with pytest.raises(ValueError, match=r"no room for obstacle \d+ of 99 .* enlarge the arena"):
        Layout.draw(scenario.model_copy(update={"obstacles": [crowd]}), 0)


def test_a_misspelt_surface_is_named_beside_those_there_are(tmp_path):
    text = Path("configs/scenarios/tiles.toml").read_text()
    (tmp_path / "bad.toml").write_text(text.replace('wall = "plaster"', 'wall = "plasterr"'))
    with pytest.raises(ConfigurationError, match=r"arena\.wall: no surface is named 'plasterr'; allowed: carton"):
        load_scenario(tmp_path / "bad.toml")


def test_a_seat_the_camera_cannot_pass_under_is_refused(tmp_path):
    text = Path("configs/scenarios/wood.toml").read_text()
    (tmp_path / "bad.toml").write_text(text.replace("height_m = [0.25, 0.35]", "height_m = [0.1, 0.35]"))
    with pytest.raises(ConfigurationError, match=r"at least 0\.15 m"):
        load_scenario(tmp_path / "bad.toml")


@pytest.mark.parametrize("pattern", PATTERNS)
def test_a_pattern_repeats_without_a_seam(pattern):
    surface = Surface(name="any", pattern=pattern, colours=("#303030", "#707070", "#b0b0b0"), period_m=1.0)
    image = texture(surface).astype(np.float64)
    for axis in (0, 1):
        steps = np.abs(np.diff(image, axis=axis, append=image.take([0], axis))).mean((1 - axis, 2))
        # A seam would stick out of all other steps along that axis; joints and stripes are as strong elsewhere.
        assert steps[-1] <= 1.2 * steps.max(initial=0.0, where=np.arange(len(steps)) < len(steps) - 1) + 1


def test_a_texture_depends_on_nothing_but_its_surface():
    first = texture(GREY)
    texture.__globals__["_draw"].cache_clear()
    assert (texture(GREY) == first).all()
    assert (texture(GREY.model_copy(update={"name": "other"})) != first).any()
