"""Driving on predictions alone: clearance, speed, turning."""

import numpy as np
import pytest

from agents.controllers.avoid import Avoid
from llrp_online.configuration.running import Control
from replay.targets import Targets

CONTROL = Control()
AHEAD = Targets.line(0.0, 0.3, 0.01)
SENSORS = ["left", "center_left", "center", "center_right", "right"]
POSE = np.zeros(3)


def avoid(seed=0):
    return Avoid(CONTROL, AHEAD, SENSORS, seed)


def felt_from(*metres):
    """For each sensor, silence up to so many metres ahead and an obstacle from there on; inf: none at all."""
    return np.stack([(AHEAD.poses[:, 0] >= m - 1e-9).astype(np.float32) for m in metres], -1)


def drive(controller, prediction):
    return controller.command(0, POSE, None, prediction)


def test_clearance_is_where_each_sensor_would_first_feel_something():
    inf = float("inf")
    found = avoid().clearance_m(felt_from(0.10, inf, 0.25, 0.0, 0.29))
    np.testing.assert_allclose(found, [0.10, 0.30, 0.25, 0.0, 0.29], atol=1e-9)


def test_one_target_alone_that_errs_is_no_obstacle():
    prediction = np.zeros((31, 5), np.float32)
    prediction[5, 2] = 1.0
    assert drive(avoid(), prediction) == (CONTROL.speed_m_s, 0.0)


def test_without_a_prediction_it_stands_still():
    assert drive(avoid(), None) == (0.0, 0.0)


def test_it_slows_down_before_what_it_turns_away_from():
    speeds = [drive(avoid(), felt_from(*[near] * 5))[0] for near in (0.30, 0.20, 0.15, 0.13)]
    assert speeds[0] == CONTROL.speed_m_s
    assert speeds == sorted(speeds, reverse=True)
    assert speeds[-1] > 0


@pytest.mark.parametrize(("clearances", "side"), [((0.05, 0.05, 0.3, 0.3, 0.3), -1), ((0.3, 0.3, 0.3, 0.3, 0.05), 1)])
def test_it_turns_to_the_side_with_more_room(clearances, side):
    assert drive(avoid(), felt_from(*clearances)) == (0.0, side * CONTROL.turn_rad_s)


def test_straight_ahead_either_side_will_do_by_the_seed():
    wall = felt_from(*[0.05] * 5)
    sides = [drive(avoid(seed), wall) for seed in range(20)]
    assert set(sides) == {(0.0, CONTROL.turn_rad_s), (0.0, -CONTROL.turn_rad_s)}
    assert sides == [drive(avoid(seed), wall) for seed in range(20)]


def test_a_turn_once_begun_is_finished():
    controller = avoid()
    turn = drive(controller, felt_from(0.05, 0.3, 0.3, 0.3, 0.3))
    assert turn[1] < 0
    # Now there is less room to the right, and the way is barely clear: it keeps turning the way it began.
    assert drive(controller, felt_from(0.3, 0.3, 0.3, 0.3, 0.06)) == turn
    assert drive(controller, felt_from(*[CONTROL.clearance_m * 1.1] * 5)) == turn
    speed, turning = drive(controller, felt_from(*[0.2] * 5))
    assert (speed > 0, turning) == (True, 0.0)


def test_targets_to_the_side_are_refused():
    grid = Targets.grid((0.0, 0.2, 0.1), (-0.1, 0.1, 0.1))
    with pytest.raises(ValueError, match='expected \\[targets\\] kind = "line", straight ahead'):
        Avoid(CONTROL, grid, SENSORS, 0)
