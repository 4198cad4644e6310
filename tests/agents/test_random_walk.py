"""The random walk, on hand-made bits and in an arena."""

import numpy as np
import pytest

from agents.controllers.random_walk import Phase, RandomWalk
from agents.robots.simulated import SimulatedRobot, load_scenario
from agents.rollout import rollout
from llrp_online.configuration import load
from llrp_online.configuration.running import Control

CONTROL = Control()
NOTHING = np.zeros(5, np.int8)
LEFT = np.array([1, 1, 0, 0, 0], np.int8)
TICK_NS = 50_000_000


def test_it_drives_straight_on_where_nothing_is_felt():
    assert RandomWalk(CONTROL, 0).command(0, np.zeros(3), NOTHING, None) == (CONTROL.speed_m_s, 0.0)


@pytest.mark.parametrize(("bits", "side"), [(LEFT, -1), (LEFT[::-1], 1)])
def test_it_turns_away_from_the_side_that_feels_more(bits, side):
    speed, turn = RandomWalk(CONTROL, 0).command(0, np.zeros(3), bits, None)
    assert speed == 0
    assert np.sign(turn) == side


def test_it_turns_by_a_random_angle_and_either_way_from_what_is_straight_ahead():
    turned = []
    for seed in range(20):
        walk, pose, ahead = RandomWalk(CONTROL, seed), np.zeros(3), np.array([0, 0, 1, 0, 0], np.int8)
        for tick in range(200):
            _, turn = walk.command(tick * TICK_NS, pose, ahead if tick == 0 else NOTHING, None)
            if walk.phase is Phase.FORWARD:
                break
            pose = pose + np.array([0, 0, turn * 0.05])
        turned.append(pose[2])
    assert (np.abs(turned) > np.pi / 3 - 0.03).all()
    assert (np.abs(turned) < np.pi).all()
    assert np.ptp(np.abs(turned)) > 0.5
    assert min(turned) < 0 < max(turned)


def test_it_turns_on_while_something_is_felt():
    walk, pose, ticks = RandomWalk(CONTROL, 0), np.zeros(3), 0
    while abs(pose[2]) < 2 * np.pi:
        speed, turn = walk.command(ticks * TICK_NS, pose, LEFT, None)
        assert speed == 0
        pose, ticks = pose + np.array([0, 0, turn * 0.05]), ticks + 1
        assert ticks < 1000
    assert pose[2] < 0  # to the right, all the way


def test_stuck_it_backs_off_before_it_turns():
    walk, phases = RandomWalk(CONTROL, 0), []
    pose = np.zeros(3)
    for tick in range(100):
        speed, turn = walk.command(tick * TICK_NS, pose, NOTHING, None)
        phases.append(walk.phase)
        pose = pose + np.array([min(speed, 0.0) * 0.05, 0, turn * 0.05])  # it can go back, not on
        if walk.phase is Phase.TURN:
            break
    assert list(dict.fromkeys(phases)) == [Phase.FORWARD, Phase.BACK_OFF, Phase.TURN]
    assert pose[0] == pytest.approx(-0.05, abs=0.005)


def test_without_recent_bits_it_stands_still():
    walk = RandomWalk(CONTROL, 0)
    assert [walk.command(tick * TICK_NS, np.zeros(3), None, None) for tick in range(50)] == [(0.0, 0.0)] * 50


def test_it_roams_an_arena_for_minutes_and_rarely_touches_anything():
    configuration = load("configs/thymio.toml")
    robot = SimulatedRobot(configuration.simulation, load_scenario("configs/scenarios/stone.toml"), 0, None)
    walk = RandomWalk(configuration.control, 0)
    seen = np.array([one.true_pose for one in rollout(robot, walk, configuration, 180)])
    assert len(np.unique((seen[:, :2] // 0.25), axis=0)) >= 10  # squares of 25 cm it came through
    assert robot.collisions <= 10
