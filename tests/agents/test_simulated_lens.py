"""What makes a picture less than sharp or well lit, and that by default nothing does."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from agents.robots.simulated import SimulatedRobot, load_scenario
from agents.robots.simulated.camera import Camera
from agents.robots.simulated.layout import Layout
from agents.robots.simulated.lens import SMEARED_OVER, blurred, smeared, way
from agents.robots.simulated.world import World
from llrp_online.configuration.running import Simulation

TILES = load_scenario("configs/scenarios/tiles.toml")
WORLD = World(Layout.draw(TILES, seed=0))
POSE = np.array([0.1, 0.2, 0.3])


def camera(**settings):
    return Camera(WORLD, TILES.light, Simulation(**settings), 64, 80)


@pytest.mark.parametrize("exposure", [0.5, 1.6, 4.0])
def test_exposure_scales_all_that_is_seen_up_to_white(exposure):
    usual, found = camera().picture(POSE).astype(float), camera(exposure=exposure).picture(POSE).astype(float)
    dim = usual < 254  # what is white already may have been brighter
    # Both were rounded down: the usual one by up to 1, which is then scaled.
    low, high = np.floor(exposure * usual), exposure * (usual + 1)
    assert (found[dim] >= np.minimum(low, 255)[dim]).all()
    assert (found[dim] <= np.minimum(high, 255)[dim]).all()
    assert found.max() == (255 if exposure == 4.0 else found.max())


def test_the_hall_around_the_arena_is_exposed_too():
    up = {"pitch_deg": 0.0, "camera_height_m": 0.5}
    usual, dark = camera(**up).picture(POSE)[0], camera(exposure=0.5, **up).picture(POSE)[0]
    assert (usual == (175, 182, 190)).all()
    assert (dark == (87, 91, 95)).all()


pictures = arrays(np.uint8, st.tuples(st.integers(1, 12), st.integers(1, 12), st.just(3)))


@settings(max_examples=40)
@given(pictures, st.floats(0.2, 3.0))
def test_blur_keeps_to_what_is_there_and_knows_no_direction(picture, sigma_px):
    found = blurred(picture, sigma_px)
    assert (found.min((0, 1)) >= picture.min((0, 1))).all()
    assert (found.max((0, 1)) <= picture.max((0, 1))).all()
    for turned in (picture[::-1], picture[:, ::-1]):
        mirrored = blurred(turned, sigma_px)
        back = mirrored[::-1] if turned is not picture and (turned == picture[::-1]).all() else mirrored[:, ::-1]
        assert np.abs(back.astype(int) - found).max() <= 1  # the last bit of a sum taken the other way round


@pytest.mark.parametrize("sigma_px", [0.8, 1.5, 3.0])
@pytest.mark.parametrize("upright", [True, False])
def test_how_brightness_rises_across_an_edge_is_a_gaussian_of_that_deviation(sigma_px, upright):
    half = np.zeros((60, 60, 3), np.uint8)
    half[:, 30:] = 255
    found = blurred(half if upright else half.swapaxes(0, 1), sigma_px)
    edge = np.diff((found if upright else found.swapaxes(0, 1))[20, :, 0].astype(float))
    offset = np.arange(59) - 29
    assert (edge * offset).sum() / edge.sum() == pytest.approx(0, abs=0.1)
    assert np.sqrt((edge * offset**2).sum() / edge.sum()) == pytest.approx(sigma_px, rel=0.05)


def test_the_camera_blurs_what_it_would_have_seen_sharp():
    np.testing.assert_array_equal(camera(blur_px=1.5).picture(POSE), blurred(camera().picture(POSE), 1.5))


def test_an_open_shutter_averages_what_is_seen_along_the_way():
    before = POSE - [0.006, 0.0, 0.07]
    sharp = camera()
    along = [sharp.picture(pose) for pose in way(before, POSE, 0.8)]
    assert len(along) == SMEARED_OVER
    found = camera(shutter_s=0.04).picture(POSE, before)  # of a tick of 50 ms
    np.testing.assert_array_equal(found, smeared(along))
    assert np.abs(found - np.mean(along, 0)).max() <= 0.5
    assert (found != sharp.picture(POSE)).any()


def test_the_way_ends_now_and_takes_the_short_turn():
    before, now = np.array([0.0, 0.0, np.pi - 0.01]), np.array([0.0, 0.0, -np.pi + 0.01])
    poses = np.array(list(way(before, now, 1.0)))
    np.testing.assert_array_equal(poses[-1], now)
    assert np.ptp(poses[:, 2]) < 0.02
    assert before.tolist() == [0.0, 0.0, np.pi - 0.01]


@settings(max_examples=20)
@given(pictures)
def test_who_stands_still_smears_nothing(picture):
    np.testing.assert_array_equal(smeared([picture] * SMEARED_OVER), picture)


def test_standing_still_a_robot_with_an_open_shutter_sees_sharp():
    def first(**settings):
        return SimulatedRobot(Simulation(**settings), TILES, seed=0, picture=(64, 80)).step(0.0, 0.0).picture

    np.testing.assert_array_equal(first(shutter_s=0.05), first())


def test_a_shutter_open_longer_than_a_tick_is_refused():
    with pytest.raises(ValueError, match=r"at most one tick, 0\.05 s at rate_hz = 20, got 0\.06"):
        Simulation(shutter_s=0.06)
