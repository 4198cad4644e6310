"""Seeking: what it knows of places, how it moves on hand-made bits, that it meets more than the paper's behaviour."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.controllers.explore import Explore
from agents.controllers.known import REMEMBER_S, Known
from agents.controllers.seek import Phase, Seek
from agents.robots.simulated import SimulatedRobot, load_scenario
from agents.rollout import rollout
from llrp_online.configuration import load
from llrp_online.configuration.running import Control

CONTROL = Control()
HERE = np.zeros(3)
NOTHING = np.zeros(5, np.int8)
AHEAD = np.array([0, 0, 1, 0, 0], np.int8)
TICK_NS = 50_000_000
HEADINGS = st.floats(-3.1, 3.1)


@given(HEADINGS, st.floats(0.05, 0.95))
def test_a_line_once_driven_is_worth_less(heading, way_m):
    known = Known()
    new = known.novelty(0, HERE, heading)
    known.drove(np.array([way_m * np.cos(heading), way_m * np.sin(heading), heading]))
    assert known.novelty(0, HERE, heading) <= new


def test_a_place_crossed_in_another_direction_keeps_some_of_its_worth():
    same, other = Known(), Known()
    same.drove(np.array([0.55, 0.05, 0.0]))
    other.drove(np.array([0.55, 0.05, np.pi / 2]))
    at = np.array([0.05, 0.05, 0.0])
    assert same.novelty(0, at, 0.0) < other.novelty(0, at, 0.0) < Known().novelty(0, at, 0.0)


@given(HEADINGS)
def test_nothing_is_worth_less_than_a_run_that_ends_at_once_until_that_is_forgotten(heading):
    known = Known()
    known.met(0, np.array([0.05, 0.05, heading]), 0.1)
    at = np.array([0.05, 0.05, 0.0])
    assert known.novelty(1, at, heading) < known.novelty(1, at, heading + np.pi)
    assert known.novelty(round(REMEMBER_S * 1e9), at, heading) == Known().novelty(0, at, heading)


def test_it_drives_on_a_little_from_where_it_feels_something_then_turns_away():
    seek, pose, phases = Seek(CONTROL, 0), np.zeros(3), []
    for tick in range(100):
        speed, turn = seek.command(tick * TICK_NS, pose, AHEAD if seek.phase is not Phase.TURN else NOTHING, None)
        phases.append(seek.phase)
        if len(phases) > 1 and phases[-2:] == [Phase.TURN, Phase.FORWARD]:
            break
        pose = pose + 0.05 * np.array([speed, 0.0, turn])
    assert list(dict.fromkeys(phases)) == [Phase.CLOSER, Phase.TURN, Phase.FORWARD]
    assert CONTROL.closer_m <= pose[0] < CONTROL.closer_m + 2 * 0.05 * CONTROL.seek_speed_m_s
    assert abs(pose[2]) > 0.2  # another way than to what it met


def test_felt_all_around_it_gives_up_turning_after_a_full_circle():
    seek, pose, turned_rad = Seek(CONTROL, 0), np.zeros(3), 0.0
    seek.phase = Phase.TURN
    for tick in range(400):
        _, turn = seek.command(tick * TICK_NS, pose, AHEAD, None)
        if seek.phase is Phase.CLOSER:
            break
        turned_rad += abs(0.05 * turn)
        pose = pose + np.array([0.0, 0.0, 0.05 * turn])
    assert seek.phase is Phase.CLOSER
    assert 2 * np.pi - 0.5 < turned_rad < 4 * np.pi


def test_stuck_it_backs_off():
    seek = Seek(CONTROL, 0)
    commands = [seek.command(tick * TICK_NS, HERE, NOTHING, None) for tick in range(20)]
    assert (-CONTROL.seek_speed_m_s, 0.0) in commands


def test_without_recent_bits_it_stands_still():
    assert Seek(CONTROL, 0).command(0, HERE, None, None) == (0.0, 0.0)


@pytest.mark.parametrize("name", ["wood", "concrete"])
def test_it_meets_far_more_than_the_papers_behaviour_and_runs_into_less(name):
    configuration, scenario = load("configs/thymio.toml"), load_scenario(f"configs/scenarios/{name}.toml")
    posts: list[int] = []
    collisions: list[int] = []
    for pilot in (Seek(configuration.control, 1), Explore(configuration.control, 1)):
        robot = SimulatedRobot(configuration.simulated(), scenario, 1, None)
        seen = list(rollout(robot, pilot, configuration, 120))
        limits = [sensor.below for sensor in configuration.short_range]
        felt = [one.true_pose for one in seen if (one.ranges[::-1] < limits).any()]
        posts.append(len({tuple(np.round(pose[:2] / 0.1).tolist()) for pose in felt}))
        collisions.append(robot.collisions)
    assert posts[0] > 2 * posts[1]
    assert collisions[0] < collisions[1]
