"""The body: wheels, odometry, collisions. No camera, no MuJoCo."""

import numpy as np
import pytest

from agents.robots.simulated.body import Body
from agents.robots.simulated.layout import Footprints, Shape
from agents.robots.simulated.scenario import Surface
from llrp_online.configuration.running import Simulation
from replay.poses import wrap

GREY = Surface(name="grey", pattern="plain", colours=("#808080", "#909090"), period_m=1.0)
IDEAL = Simulation(slip=0.0, bias=0.0, wheel_acceleration_m_s2=100.0)
DT = 0.05


def body(simulation=IDEAL, shapes=(), start=(0.0, 0.0, 0.0), seed=0):
    return Body(simulation, Footprints(list(shapes)), start, np.random.default_rng(seed))


def wall_at(x_m):
    return Shape("box", (x_m + 0.5, 0.0, 0.15), (0.5, 2.0, 0.15), GREY)


def drive_at_random(one, seed, ticks):
    rng = np.random.default_rng(seed)
    command = np.zeros(2)
    for tick in range(ticks):
        if tick % 20 == 0:
            command = rng.uniform([-0.15, -1.0], [0.15, 1.0])
        one.step(*command, DT)


def test_without_noise_odometry_is_the_true_pose():
    one = body(start=(0.0, 0.0, 0.0))
    drive_at_random(one, seed=1, ticks=400)
    assert np.hypot(*one.true_pose[:2]) > 0.1
    np.testing.assert_allclose(one.odometry, one.true_pose, atol=1e-9)
    assert (one.covariance == 0).all()


def test_a_full_turn_on_an_arc_ends_where_it_began():
    one, ticks = body(), 200
    for _ in range(ticks):
        one.step(0.1, 2 * np.pi / (ticks * DT), DT)
    np.testing.assert_allclose(one.true_pose, np.zeros(3), atol=1e-9)


def test_positive_turns_are_to_the_left():
    one = body()
    one.step(0.1, 0.5, DT)
    assert one.true_pose[1] > 0
    assert one.true_pose[2] == pytest.approx(0.5 * DT)


def test_wheels_are_limited_and_the_curvature_is_kept():
    one = body()
    one.step(1.0, 4.0, DT)
    left, right = one.twist[0] + np.array([-1, 1]) * one.twist[1] * IDEAL.track_m / 2
    assert right == pytest.approx(IDEAL.wheel_limit_m_s)
    assert left < right
    assert one.twist[1] / one.twist[0] == pytest.approx(4.0)


def test_wheels_need_their_time_to_stop():
    one = body(Simulation(slip=0.0, bias=0.0))
    for _ in range(20):
        one.step(0.12, 0.0, DT)
    before = one.true_pose[0]
    for _ in range(20):
        one.step(0.0, 0.0, DT)
    assert 0.005 < one.true_pose[0] - before < 0.015
    assert one.twist.tolist() == [0.0, 0.0]


def test_slip_makes_odometry_drift_as_its_covariance_says():
    simulation, runs, squared = Simulation(slip=0.04, bias=0.0), 200, []
    for seed in range(runs):
        one = body(simulation, seed=seed)
        drive_at_random(one, seed=1000 + seed, ticks=160)
        error = one.true_pose - one.odometry
        error[2] = wrap(error[2])
        squared.append(error @ np.linalg.solve(one.covariance, error))
    # Chi-squared with three degrees of freedom: mean 3, deviation sqrt(6); four standard errors of the mean either way.
    assert abs(np.mean(squared) - 3) < 4 * np.sqrt(6 / runs)
    assert 0.02 < np.mean(np.array(squared) > 7.81) < 0.09  # the 95 % quantile


def test_slip_has_its_meaning_after_a_centimetre_and_grows_with_the_root_of_the_way():
    one = body(IDEAL.model_copy(update={"slip": 0.02}))
    for _ in range(200):
        one.step(0.1, 0.0, DT)
    expected_rad = np.sqrt(2 * 0.02**2 * 0.01 * 1.0) / IDEAL.track_m  # two wheels, one metre
    assert np.sqrt(one.covariance[2, 2]) == pytest.approx(expected_rad, rel=1e-6)


def test_a_radius_bias_bends_the_same_way_all_run_long():
    one = body(IDEAL.model_copy(update={"bias": 0.02}), seed=5)
    yaws = []
    for _ in range(100):
        one.step(0.1, 0.0, DT)
        yaws.append(one.true_pose[2])
    np.testing.assert_allclose(np.diff(yaws), yaws[0], rtol=1e-6)
    assert yaws[0] != 0
    assert one.odometry[2] == 0


def test_the_rim_stops_at_a_wall_and_the_wheels_stall():
    one = body(shapes=[wall_at(0.3)])
    for _ in range(80):
        one.step(0.1, 0.0, DT)
    rim_m = one.true_pose[0] + IDEAL.centre_ahead_m + IDEAL.radius_m
    assert rim_m == pytest.approx(0.3, abs=1e-5)
    assert rim_m <= 0.3 + 1e-8
    np.testing.assert_allclose(one.odometry, one.true_pose, atol=1e-9)
    assert one.blocked
    assert abs(one.twist[0]) < 1e-3


def test_each_contact_is_one_collision():
    one = body(shapes=[wall_at(0.25)])
    for _ in range(2):
        for speed, ticks in ((0.1, 60), (-0.1, 20)):
            for _ in range(ticks):
                one.step(speed, 0.0, DT)
    assert one.collisions == 2
    assert not one.blocked


def test_a_thin_pole_is_not_driven_over():
    pole = Shape("cylinder", (0.2, 0.01, 0.2), (0.005, 0.005, 0.2), GREY)
    one = body(IDEAL, shapes=[pole])
    for _ in range(100):
        one.step(0.2, 0.0, DT)
    assert one.collisions == 1
    assert one.true_pose[0] < 0.2


def test_it_never_enters_anything_on_a_wild_drive():
    shapes = [wall_at(0.5), Shape("cylinder", (-0.2, 0.15, 0.1), (0.05, 0.05, 0.1), GREY)]
    shapes.append(Shape("box", (-0.1, -0.3, 0.1), (0.2, 0.05, 0.1), GREY, yaw_rad=0.4))
    footprints, one = Footprints(shapes), body(Simulation(), shapes=shapes)
    rng = np.random.default_rng(0)
    for _ in range(2000):
        one.step(*rng.uniform([-0.1, -3.0], [0.3, 3.0]), DT)
        x, y, yaw = one.true_pose
        centre = [x + IDEAL.centre_ahead_m * np.cos(yaw), y + IDEAL.centre_ahead_m * np.sin(yaw)]
        assert footprints.clearance_m(centre) >= IDEAL.radius_m - 1e-8
    assert one.collisions > 3


def test_a_command_that_is_no_number_is_refused():
    with pytest.raises(ValueError, match="finite speeds, got nan"):
        body().step(float("nan"), 0.0, DT)


def test_a_start_inside_an_obstacle_is_refused():
    with pytest.raises(ValueError, match="inside an obstacle"):
        body(shapes=[wall_at(0.05)])
