"""Camera and proximity sensors against things placed by hand."""

import numpy as np
import pytest

from agents.robots.simulated import load_scenario
from agents.robots.simulated.camera import Camera, Optics
from agents.robots.simulated.layout import Layout, Shape
from agents.robots.simulated.proximity import Proximity
from agents.robots.simulated.scenario import Light, Surface
from agents.robots.simulated.world import World
from llrp_online.configuration import load
from llrp_online.configuration.running import Simulation

SCENARIO = load_scenario("configs/scenarios/tiles.toml")
BLACK = Surface(name="black", pattern="plain", colours=("#000000", "#000000"), period_m=1.0)
NOISELESS = Simulation(range_noise_m=0.0)
FROM_ABOVE = Light(azimuth_deg=0, elevation_deg=90, distance_m=100, strength=0.6, ambient=0.4)
ORIGIN = np.zeros(3)
RIM_M = NOISELESS.centre_ahead_m + NOISELESS.radius_m


def world_of(*shapes):
    return World(Layout(SCENARIO, list(shapes), (0.0, 0.0, 0.0)))


def ranges_with(*shapes, simulation=NOISELESS, pose=ORIGIN):
    return Proximity(world_of(*shapes), simulation, np.random.default_rng(0)).ranges(pose)


def plate(bearing_deg, distance_m):
    """A box, 4 cm wide, whose face is square to one sensor's axis and this far from it."""
    bearing = np.deg2rad(bearing_deg)
    reach = NOISELESS.radius_m + distance_m + 0.01
    x, y = NOISELESS.centre_ahead_m + reach * np.cos(bearing), reach * np.sin(bearing)
    return Shape("box", (x, y, 0.05), (0.01, 0.02, 0.05), BLACK, yaw_rad=bearing)


def picture_with(*shapes, light=FROM_ABOVE, pose=ORIGIN, size=(64, 80)):
    return Camera(world_of(*shapes), light, NOISELESS, *size).picture(pose)


@pytest.mark.parametrize(("index", "bearing_deg"), list(enumerate([-40, -20, 0, 20, 40])))
def test_each_sensor_feels_what_stands_before_it_and_how_far(index, bearing_deg):
    ranges = ranges_with(plate(bearing_deg, 0.04))
    assert ranges[index] == pytest.approx(0.04, abs=1e-6)
    assert ranges.argmin() == index


def test_the_left_sensor_is_the_last_of_the_scan_and_the_first_of_the_configuration():
    configuration = load("configs/thymio.toml")
    ranges = ranges_with(plate(40, 0.05))  # to the left: counter-clockwise
    assert np.isfinite(ranges[4])
    assert np.isinf(ranges[:3]).all()
    assert configuration.short_range[0].name == "left"
    assert configuration.short_range[0].field == "ranges[4]"


@pytest.mark.parametrize(("distance_m", "felt"), [(0.001, True), (0.099, True), (0.101, False)])
def test_the_reach_is_ten_centimetres(distance_m, felt):
    assert np.isfinite(ranges_with(plate(0, distance_m))[2]) == felt


def test_noise_blurs_the_reading_and_the_edge_of_the_reach():
    noisy = Proximity(world_of(plate(0, 0.1)), Simulation(range_noise_m=0.003), np.random.default_rng(0))
    readings = np.array([noisy.ranges(ORIGIN)[2] for _ in range(400)])
    assert 0.4 < np.isfinite(readings).mean() < 0.6
    near = Proximity(world_of(plate(0, 0.05)), Simulation(range_noise_m=0.003), np.random.default_rng(0))
    assert np.std([near.ranges(ORIGIN)[2] for _ in range(400)]) == pytest.approx(0.003, rel=0.15)


def test_a_thin_pole_off_the_axis_is_felt_by_the_cone_and_not_by_a_ray():
    angle = np.deg2rad(6)
    x, y = RIM_M + 0.08 * np.cos(angle), 0.08 * np.sin(angle)
    pole = Shape("cylinder", (x, y, 0.1), (0.005, 0.005, 0.1), BLACK)
    assert np.isfinite(ranges_with(pole)[2])
    assert np.isinf(ranges_with(pole, simulation=NOISELESS.model_copy(update={"beam_width_deg": 0.0}))[2])


def test_sensors_turn_with_the_robot():
    away, towards = np.array([0.0, 0.0, np.pi]), np.array([0.3, 0.0, np.pi])
    assert np.isinf(ranges_with(plate(0, 0.05), pose=away)).all()
    assert np.isfinite(ranges_with(plate(0, 0.05), pose=towards)[2])


def block_ahead(distance_m):
    """A wide black block whose foot is this far ahead of the middle sensor."""
    return Shape("box", (RIM_M + distance_m + 0.1, 0.0, 0.1), (0.1, 1.0, 0.1), BLACK)


def test_what_is_first_felt_at_28_cm_stands_at_the_top_edge():
    optics = Optics.build(NOISELESS, 64, 80)
    foot_m = RIM_M + 0.28 + NOISELESS.range_m
    down_rad = np.arctan2(NOISELESS.camera_height_m, foot_m - NOISELESS.camera_ahead_m)
    below_middle_px = np.tan(down_rad - np.deg2rad(NOISELESS.pitch_deg)) / optics.pixel_rad
    assert abs(32 + below_middle_px) < 1  # from the picture's upper edge


@pytest.mark.parametrize(("distance_m", "rows"), [(0.40, (0, 0)), (0.36, (1, 4)), (0.20, (15, 25)), (0.05, (45, 62))])
def test_an_obstacle_covers_more_rows_the_nearer_it_is(distance_m, rows):
    picture = picture_with(block_ahead(distance_m))
    black = (picture == 0).all(-1)[:, 40]
    assert rows[0] <= black.sum() <= rows[1]
    assert black[: black.sum()].all()  # from the top edge down, without a gap


def test_the_field_of_view_is_68_degrees_across():
    row = Optics.build(NOISELESS.model_copy(update={"pitch_deg": 0.0}), 65, 80).directions.reshape(65, 80, 3)[32]
    left_rad, right_rad = (np.arctan2(ray[1], ray[0]) for ray in (row[0], row[-1]))
    assert left_rad == pytest.approx(-right_rad)
    assert np.rad2deg(left_rad) == pytest.approx(34, abs=0.5)
    assert left_rad > 0  # the left column looks to the left


def test_what_stands_on_the_left_is_seen_on_the_left():
    post = Shape("cylinder", (0.3, 0.1, 0.1), (0.03, 0.03, 0.1), BLACK)
    columns = np.flatnonzero((picture_with(post) == 0).all(-1).any(0))
    assert len(columns) > 3
    assert columns.max() < 40


def test_a_shadow_falls_away_from_the_lamp():
    post = Shape("cylinder", (0.3, 0.0, 0.1), (0.02, 0.02, 0.1), BLACK)
    from_right = FROM_ABOVE.model_copy(update={"azimuth_deg": -90, "elevation_deg": 45})
    lit, unlit = picture_with(post, light=from_right), picture_with(light=from_right)
    darker = (lit.astype(int).sum(-1) < 0.75 * unlit.astype(int).sum(-1)) & (lit > 0).any(-1)
    assert darker[:, :36].sum() > 50
    assert darker[:, 44:].sum() == 0


def test_nothing_shadows_itself():
    flat = Light(azimuth_deg=20, elevation_deg=15, distance_m=100, strength=0.9, ambient=0.2)
    white = Surface(name="white", pattern="plain", colours=("#c0c0c0", "#c0c0c0"), period_m=1.0)
    scenario = SCENARIO.model_copy(
        update={"surface": [white], "arena": SCENARIO.arena.model_copy(update={"floor": "white", "wall": "white"})}
    )
    world = World(Layout(scenario, [], (0.0, 0.0, 0.0)))
    picture = Camera(world, flat, NOISELESS, 64, 80).picture(ORIGIN)
    assert np.ptp(picture) <= 1


def test_far_texture_is_averaged_rather_than_picked():
    fine = Surface(name="fine", pattern="checker", colours=("#000000", "#ffffff"), period_m=0.004)
    scenario = SCENARIO.model_copy(
        update={"surface": [fine], "arena": SCENARIO.arena.model_copy(update={"floor": "fine", "wall": "fine"})}
    )
    picture = Camera(World(Layout(scenario, [], (0.0, 0.0, 0.0))), FROM_ABOVE, NOISELESS, 64, 80).picture(ORIGIN)
    assert picture.astype(float).std() < 8  # squares of 1 mm under pixels of 2 mm and more: grey, no moire
