"""Driving on predictions alone: clearance, speed, turning."""

import numpy as np
import pytest

from agents.controllers.avoid import Avoid
from llrp_online.configuration.running import Control
from replay.targets import Targets

CONTROL = Control(threshold=0.5)
AHEAD = Targets.line(0.0, 0.3, 0.01)
SENSORS = ["left", "center_left", "center", "center_right", "right"]
POSE = np.zeros(3)


TICK_NS = 50_000_000


def avoid(seed=0):
    return Avoid(CONTROL, AHEAD, SENSORS, seed)


def felt_from(*metres):
    """For each sensor, silence up to so many metres ahead and an obstacle from there on; inf: none at all."""
    return np.stack([(AHEAD.poses[:, 0] >= m - 1e-9).astype(np.float32) for m in metres], -1)


CLEAR, WALL = felt_from(*[np.inf] * 5), felt_from(*[0.05] * 5)


class World:
    """A robot that does as it is told, and what it sees; unless it is held, when its odometry stands still."""

    def __init__(self, controller):
        self.controller, self.pose, self.t_ns = controller, np.zeros(3), 0

    def drive(self, prediction, ticks=1, held=False):
        commands = []
        for _ in range(ticks):
            speed, turn = self.controller.command(self.t_ns, self.pose, None, prediction)
            commands.append((speed, turn))
            self.t_ns += TICK_NS
            if not held:
                heading = self.pose[2]
                self.pose = self.pose + np.array([speed * np.cos(heading), speed * np.sin(heading), turn]) * 0.05
        return commands


def first(prediction, seed=0):
    return World(avoid(seed)).drive(prediction)[0]


def test_clearance_is_where_each_sensor_would_first_feel_something():
    inf = float("inf")
    found = avoid().clearance_m(felt_from(0.10, inf, 0.25, 0.0, 0.29))
    np.testing.assert_allclose(found, [0.10, 0.30, 0.25, 0.0, 0.29], atol=1e-9)


def test_one_target_alone_that_errs_is_no_obstacle():
    prediction = np.zeros((31, 5), np.float32)
    prediction[5, 2] = 1.0
    assert first(prediction) == (CONTROL.speed_m_s, 0.0)


def test_without_a_prediction_it_stands_still_whatever_it_was_doing():
    world = World(avoid())
    for prediction in (CLEAR, WALL):
        assert world.drive(None, 3) == [(0.0, 0.0)] * 3
        assert world.drive(prediction, 3)[-1] != (0.0, 0.0)
    assert world.drive(None) == [(0.0, 0.0)]


def test_standing_still_for_want_of_predictions_is_not_being_stuck():
    world = World(avoid())
    world.drive(CLEAR, 5)
    world.drive(None, 100)
    assert world.drive(CLEAR, 5) == [(CONTROL.speed_m_s, 0.0)] * 5


def test_it_slows_down_before_what_it_turns_away_from():
    speeds = [first(felt_from(*[near] * 5))[0] for near in (0.30, 0.20, 0.15, 0.13)]
    assert speeds[0] == CONTROL.speed_m_s
    assert speeds == sorted(speeds, reverse=True)
    assert speeds[-1] > 0


@pytest.mark.parametrize(("clearances", "side"), [((0.05, 0.05, 0.3, 0.3, 0.3), -1), ((0.3, 0.3, 0.3, 0.3, 0.05), 1)])
def test_it_turns_to_the_side_with_more_room(clearances, side):
    assert first(felt_from(*clearances)) == (0.0, side * CONTROL.turn_rad_s)


def test_straight_ahead_either_side_will_do_by_the_seed():
    sides = [first(WALL, seed) for seed in range(20)]
    assert set(sides) == {(0.0, CONTROL.turn_rad_s), (0.0, -CONTROL.turn_rad_s)}
    assert sides == [first(WALL, seed) for seed in range(20)]


def test_a_turn_once_begun_keeps_its_side_until_the_way_is_clear():
    world = World(avoid())
    turn = world.drive(felt_from(0.05, 0.3, 0.3, 0.3, 0.3))[0]
    assert turn == (0.0, -CONTROL.turn_rad_s)
    assert world.drive(felt_from(0.3, 0.3, 0.3, 0.3, 0.06), 4) == [turn] * 4
    assert world.drive(CLEAR, 20)[-1] == (CONTROL.speed_m_s, 0.0)


def test_held_by_what_no_picture_shows_it_gets_away_from_there():
    world = World(avoid())
    world.drive(CLEAR, 20)
    held = world.drive(CLEAR, round(CONTROL.stuck_s * 20) + 10, held=True)
    assert held[0] == (CONTROL.speed_m_s, 0.0)
    assert held[-1][0] <= 0
    freed = world.drive(CLEAR, 100)
    assert any(turn for _, turn in freed)
    assert freed[-1] == (CONTROL.speed_m_s, 0.0)


def test_where_it_was_held_it_does_not_drive_again_for_a_while():
    world = World(avoid())
    world.drive(CLEAR, 20)
    place = world.pose
    world.drive(CLEAR, round(CONTROL.stuck_s * 20) + 2, held=True)
    world.drive(CLEAR, 100)
    for left_m, side in ((0.03, 1), (-0.03, -1)):  # the place lies to the right of the way, then to the left
        world.pose = place + np.array([-0.05, left_m, 0.0])
        assert world.drive(CLEAR)[0] == (0.0, side * CONTROL.turn_rad_s)
        away = world.drive(CLEAR, 100)
        assert away[-1] == (CONTROL.speed_m_s, 0.0)
        assert np.hypot(*(world.pose - place)[:2]) > 0.1
    world.pose = place + np.array([-0.05, 0.3, 0.0])
    assert world.drive(CLEAR)[0] == (CONTROL.speed_m_s, 0.0)
    world.t_ns += 300_000_000_000
    world.pose = place
    world.drive(None)
    assert world.drive(CLEAR)[0] == (CONTROL.speed_m_s, 0.0)


def test_targets_to_the_side_are_refused():
    grid = Targets.grid((0.0, 0.2, 0.1), (-0.1, 0.1, 0.1))
    with pytest.raises(ValueError, match='expected \\[targets\\] kind = "line", straight ahead'):
        Avoid(CONTROL, grid, SENSORS, 0)
