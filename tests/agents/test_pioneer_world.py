"""The simulated Pioneer: its floor, what its cameras and its floor sensor make of it, and where it drives."""

import math
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from agents.robots.pioneer import Eyes, Floor, Pinhole, PioneerWorld, drive, load_world
from agents.robots.pioneer.floor import perlin
from agents.robots.pioneer.world import CameraTable, DriveTable, FloorTable
from llrp_online.configuration import ConfigurationError, validate

WORLD = load_world(Path(__file__).parents[2] / "configs/worlds/pioneer.toml")
SMALL = FloorTable(side_m=12.8, cell_m=4.0, texel_m=0.05)
HEIGHT, WIDTH = 64, 80


@given(
    yaw=st.floats(-180, 180),
    pitch=st.floats(35, 90),
    roll=st.floats(-180, 180),
    height=st.floats(0.3, 2.0),
    row=st.integers(0, HEIGHT - 1),
    column=st.integers(0, WIDTH - 1),
)
def test_a_floor_point_is_seen_where_projection_says(
    yaw: float, pitch: float, roll: float, height: float, row: int, column: int
) -> None:
    camera = CameraTable(
        height_m=height, ahead_m=0.1, left_m=-0.2, yaw_deg=yaw, pitch_deg=pitch, roll_deg=roll, field_of_view_deg=70
    )
    pinhole = Pinhole(camera, HEIGHT, WIDTH)
    point = pinhole.plane_points(0.0)[0][row, column]
    assume(np.isfinite(point).all() and np.abs(point).max() < 100)
    assert pinhole.pixel_of(point) == pytest.approx([row + 0.5, column + 0.5], abs=1e-6)
    # And by angles alone: from the optical axis it is as far as the pixel is from the picture's middle.
    yaw_rad, pitch_rad = math.radians(yaw), math.radians(pitch)
    ahead = [math.cos(pitch_rad) * math.cos(yaw_rad), math.cos(pitch_rad) * math.sin(yaw_rad), -math.sin(pitch_rad)]
    ray = np.array([*point, 0.0]) - [0.1, -0.2, height]
    focal_px = WIDTH / 2 / math.tan(math.radians(35))
    off_px = math.hypot(row + 0.5 - HEIGHT / 2, column + 0.5 - WIDTH / 2)
    assert math.tan(math.acos(min(ray @ ahead / np.linalg.norm(ray), 1.0))) * focal_px == pytest.approx(
        off_px, abs=1e-3
    )


def test_what_stands_to_the_left_is_on_the_left_and_what_is_far_is_up() -> None:
    pinhole = Pinhole(CameraTable(height_m=0.6, pitch_deg=35, field_of_view_deg=70), HEIGHT, WIDTH)
    row, column = pinhole.pixel_of(np.array([[1.0, 0.3], [1.0, -0.3], [3.0, 0.0]])).T
    assert column[0] < WIDTH / 2 < column[1]
    assert row[2] < row[0]
    tilted = CameraTable(height_m=0.6, pitch_deg=35, roll_deg=20, field_of_view_deg=70)
    left, right = Pinhole(tilted, HEIGHT, WIDTH).pixel_of(np.array([[1.0, 0.3], [1.0, -0.3]]))[:, 0]
    assert left > right  # turned clockwise, its left side looks higher up: the floor there comes to lie lower


def test_a_pixel_is_as_large_as_the_distance_to_its_neighbours() -> None:
    points, pixel_m = Pinhole(WORLD.camera[0], HEIGHT, WIDTH).plane_points(0.0)
    down, right = points[2:, 1:-1] - points[:-2, 1:-1], points[1:-1, 2:] - points[1:-1, :-2]
    area = np.abs(down[..., 0] * right[..., 1] - down[..., 1] * right[..., 0]) / 4
    assert np.sqrt(area) == pytest.approx(pixel_m[1:-1, 1:-1], rel=0.05)


@given(x=st.floats(-18, 18), y=st.floats(-18, 18), yaw=st.floats(-math.pi, math.pi), seed=st.integers(0, 3))
def test_pictures_show_the_floor_that_is_there(x: float, y: float, yaw: float, seed: int) -> None:
    floor, eyes = _floor(seed)
    picture = eyes.picture(np.array([x, y, yaw]))
    assert picture.shape == (HEIGHT, WIDTH, len(WORLD.camera))
    for number, camera in enumerate(WORLD.camera):
        points, pixel_m = (seen[5:35:5, 10:80:10] for seen in Pinhole(camera, HEIGHT, WIDTH).plane_points(0.0))
        cos, sin = math.cos(yaw), math.sin(yaw)
        on_map = points @ np.array([[cos, sin], [-sin, cos]]) + [x, y]
        for (x_m, y_m), side_m, seen in zip(
            on_map.reshape(-1, 2).tolist(), pixel_m.ravel(), picture[5:35:5, 10:80:10, number].ravel(), strict=True
        ):
            if max(abs(x_m), abs(y_m)) > floor.half_m - 1:
                continue
            around = floor.mean_grey(x_m, y_m, 4 * side_m + 0.1)
            if around in (0.0, 1.0):  # else an edge runs through
                assert seen == 255 * around


def test_the_top_of_the_robot_hides_the_floor_it_stands_on() -> None:
    (_, eyes), body = _floor(0), WORLD.body
    pictures = [eyes.picture(np.array([x_m, -x_m, x_m])) for x_m in (-9.0, 0.0, 5.0)]
    for number, camera in enumerate(WORLD.camera):
        points, _ = Pinhole(camera, HEIGHT, WIDTH).plane_points(body.height_m)
        hidden = (np.abs(points) <= [body.length_m / 2, body.width_m / 2]).all(-1)
        assert hidden.any()
        assert all((picture[..., number][hidden] == body.grey).all() for picture in pictures)


def test_beyond_the_map_all_is_grey() -> None:
    floor = Floor(SMALL, 0)
    eyes = Eyes(floor, WORLD, HEIGHT, WIDTH)
    assert set(eyes.picture(np.array([100.0, 0.0, 0.0])).ravel().tolist()) == {SMALL.beyond}


@given(x=st.floats(-6, 6), y=st.floats(-6, 6), side=st.floats(0.1, 1.0))
def test_the_sensor_tells_the_mean_of_the_map_below(x: float, y: float, side: float) -> None:
    floor = Floor(SMALL, 1)
    size = len(floor.texels)
    at = (np.arange(size) + 0.5) * SMALL.side_m / size - floor.half_m
    below = np.ix_(np.abs(at - y) <= side / 2, np.abs(at - x) <= side / 2)
    assume(floor.texels[below].size > 0)
    # Texels at the rim may be counted or not.
    rim = 4 * (side / SMALL.texel_m + 1) / floor.texels[below].size
    assert floor.mean_grey(x, y, side) == pytest.approx(floor.texels[below].mean() / 255, abs=rim)


def test_a_sensor_off_the_map_is_an_error() -> None:
    with pytest.raises(ValueError, match=r"floor at \(9, 0\) m: expected a place within 6.4 m"):
        Floor(SMALL, 0).mean_grey(9.0, 0.0, 0.2)


def test_far_pixels_see_the_mean_of_what_they_cover() -> None:
    floor = Floor(SMALL, 2)
    level = floor.levels_for(np.array([8 * SMALL.texel_m]))
    assert level.tolist() == [3]
    corner = np.array([-floor.half_m + 0.1])
    assert floor.greys(corner, corner, level)[0] == pytest.approx(floor.texels[:8, :8].mean(), abs=1)


def test_half_the_floor_is_black_and_another_seed_is_another_floor() -> None:
    floors = [Floor(WORLD.floor, seed).texels for seed in (0, 1)]
    assert all(0.35 < (texels == 0).mean() < 0.65 for texels in floors)
    assert 0.3 < (floors[0] != floors[1]).mean() < 0.7
    assert np.array_equal(Floor(WORLD.floor, 0).texels, floors[0])


def test_noise_is_smooth_and_zero_at_the_lattice() -> None:
    at = np.linspace(0, 6, 601)
    noise = perlin(at, at, np.random.default_rng(0))
    assert np.abs(noise[::100, ::100]).max() < 1e-12
    assert np.abs(np.diff(noise, axis=0)).max() < 0.04
    assert np.abs(np.diff(noise, axis=1)).max() < 0.04


def test_each_step_is_the_speed_and_each_turn_lasts_its_time() -> None:
    settings = WORLD.drive
    steps = [step for step in drive(settings, 25.0, 60.0, 0) if step.trajectory == 0]
    poses = np.array([step.pose for step in steps])
    moved = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    assert moved == pytest.approx(settings.speed_m_s / settings.rate_hz, rel=1e-3)
    turned = np.degrees(np.diff(np.unwrap(poses[:, 2]))) * settings.rate_hz
    assert np.abs(turned).max() <= settings.turn_deg_s
    ticks = round(settings.turn_every_s * settings.rate_hz)
    whole = turned[: len(turned) // ticks * ticks].reshape(-1, ticks)
    assert np.ptp(whole, axis=1) == pytest.approx(0, abs=1e-6)
    assert len(set(whole[:, 0].round(6).tolist())) == len(whole)
    assert {round((b.t_ns - a.t_ns) * 1e-9, 6) for a, b in pairwise(steps)} == {0.05}


@given(seed=st.integers(0, 1000))
def test_near_the_edge_a_new_trajectory_begins_in_the_middle(seed: int) -> None:
    settings = DriveTable(rate_hz=20, speed_m_s=0.5, turn_deg_s=15, turn_every_s=3, margin_m=1)
    steps = list(drive(settings, 4.0, 40.0, seed))
    assert [step.trajectory for step in steps] == sorted(step.trajectory for step in steps)
    assert steps[-1].trajectory >= 1
    for before, after in pairwise(steps):
        assert np.abs(before.pose[:2]).max() <= 3.0
        if after.trajectory != before.trajectory:
            assert after.trajectory == before.trajectory + 1
            assert after.pose[:2].tolist() == [0.0, 0.0]
            assert np.hypot(*(after.pose - before.pose)[:2]) > 2.9


def test_the_same_seed_drives_the_same_way() -> None:
    def way(seed: int) -> list[list[float]]:
        return [step.pose.tolist() for step in drive(WORLD.drive, 25.0, 5.0, seed)]

    assert way(3) == way(3) != way(4)


def test_a_margin_that_leaves_no_room_is_an_error() -> None:
    with pytest.raises(ValueError, match=r"margin_m: expected less than 1 m"):
        list(drive(WORLD.drive, 1.0, 1.0, 0))


def test_a_camera_inside_the_body_is_refused() -> None:
    told = WORLD.model_dump(mode="json")
    told["camera"][1]["height_m"] = 0.2
    with pytest.raises(ConfigurationError, match=r"camera\[1\].height_m: expected more than body.height_m = 0.28"):
        validate(told, PioneerWorld, "world.toml")


@cache
def _floor(seed: int) -> tuple[Floor, Eyes]:
    floor = Floor(WORLD.floor, seed)
    return floor, Eyes(floor, WORLD, HEIGHT, WIDTH)
