"""The acquisition behaviour, on an ideal body and hand-made bits."""

from itertools import pairwise

import numpy as np
import pytest

from agents.controllers.explore import Explore, Phase
from agents.robots.simulated.body import Body
from agents.robots.simulated.layout import Footprints
from llrp_online.configuration.running import Control, Simulation
from replay.poses import wrap

CONTROL = Control()
DT = 0.05
NOTHING = np.zeros(5, np.int8)
AHEAD = np.array([0, 0, 1, 0, 0], np.int8)


def wall_bits(pose, wall_m=0.6):
    """A wall across the way: the middle sensor feels it within 10 cm of a 8 cm nose."""
    to_wall_m = (wall_m - pose[0]) / max(np.cos(pose[2]), 1e-6)
    return AHEAD if to_wall_m < 0.18 else NOTHING


def run(explore, seconds, bits_at=wall_bits, start=(0.0, 0.0, 0.0)):
    """[(phase after the command, pose before it, bits, command)] of every tick."""
    body = Body(Simulation(slip=0.0, bias=0.0), Footprints([]), start, np.random.default_rng(0))
    body.odometry = np.array(start)
    log = []
    for tick in range(round(seconds / DT)):
        bits = bits_at(body.odometry)
        command = explore.command(round(tick * DT * 1e9), body.odometry, bits, None)
        log.append((explore.phase, body.odometry, bits, command))
        body.step(*command, DT)
    return log


def episodes(log):
    """The log, cut where the phase changes: [(phase, poses, bits)]."""
    cuts = [i for i in range(len(log)) if i == 0 or log[i][0] is not log[i - 1][0]]
    pieces = [log[start:stop] for start, stop in zip(cuts, [*cuts[1:], len(log)], strict=True)]
    return [
        (piece[0][0], np.array([pose for _, pose, _, _ in piece]), [bits for _, _, bits, _ in piece])
        for piece in pieces
    ]


def first_obstacle(log):
    found = episodes(log)
    return found[: next(i for i, (phase, _, _) in enumerate(found) if phase is Phase.AWAY) + 2]


def test_forward_five_times_back_and_forth_then_away_and_forward_again():
    phases = [phase for phase, _, _ in first_obstacle(run(Explore(CONTROL, 0), 60))]
    look = [Phase.ALIGN, Phase.BACK, Phase.FORTH]
    assert phases == [Phase.FORWARD, *look * 5, Phase.AWAY, Phase.FORWARD]


def test_the_strokes_lie_in_the_five_directions():
    strokes = [poses for phase, poses, _ in first_obstacle(run(Explore(CONTROL, 0), 60)) if phase is Phase.BACK]
    headings_deg = [np.rad2deg(poses[len(poses) // 2, 2]) for poses in strokes]
    np.testing.assert_allclose(headings_deg, [-30, -15, 0, 15, 30], atol=1.5)


def test_every_stroke_goes_30_cm_back_and_returns():
    found = first_obstacle(run(Explore(CONTROL, 0), 60))
    for (phase, back, _), (_, forth, _) in pairwise(found):
        if phase is Phase.BACK:
            assert np.hypot(*(back[0] - forth[0])[:2]) == pytest.approx(0.30, abs=0.006)
            assert np.hypot(*(forth[-1] - back[0])[:2]) < 0.005
            way = forth[0] - back[0]
            assert way[0] * np.cos(back[0, 2]) + way[1] * np.sin(back[0, 2]) < 0  # it went backwards


def test_a_bit_stops_it_at_once():
    log = run(Explore(CONTROL, 0), 20)
    first = next(i for i, (_, _, bits, _) in enumerate(log) if bits.any())
    assert [command for _, _, _, command in log[:first]] == [(CONTROL.speed_m_s, 0.0)] * first
    assert log[first][3][0] == 0.0


@pytest.mark.parametrize("sensor", range(5))
def test_any_sensor_counts_and_unknown_does_not(sensor):
    explore, felt = Explore(CONTROL, 0), NOTHING.copy()
    felt[sensor] = -1
    assert explore.command(0, np.zeros(3), felt, None) == (CONTROL.speed_m_s, 0.0)
    felt[sensor] = 1
    assert explore.command(1, np.zeros(3), felt, None)[0] == 0.0


def test_it_turns_away_at_random_into_the_half_plane_behind():
    headings = []
    for seed in range(12):
        found = first_obstacle(run(Explore(CONTROL, seed), 60))
        headings.append(found[-1][1][0, 2])
    assert np.abs(wrap(headings)).min() > np.pi / 2 - 0.05
    assert np.ptp(np.abs(wrap(headings))) > 0.5
    assert {np.sign(heading) for heading in headings} == {-1.0, 1.0}


def test_it_looks_for_a_direction_that_is_free():
    def corridor(pose):
        """A wall ahead, and something everywhere behind but within 40 degrees of straight back."""
        behind = abs(float(wrap(pose[2] - np.pi)))
        blocked_behind = pose[0] > 0.3 and np.deg2rad(40) < behind < np.deg2rad(100)
        return AHEAD if blocked_behind else wall_bits(pose)

    went_free = 0
    for seed in range(10):
        found = first_obstacle(run(Explore(CONTROL, seed), 60, corridor))
        went_free += not corridor(found[-1][1][0]).any()
    assert went_free >= 9  # each try is free with about 45 %, and it has seven


def test_what_stands_behind_shortens_the_stroke_and_its_return():
    explore, tick = Explore(CONTROL, 0), 0
    pose, low_m = np.zeros(3), -0.1
    starts: list[float] = []
    lowest = 0.0
    while explore.phase is not Phase.AWAY and tick < 2000:
        before = explore.phase
        speed, turn = explore.command(round(tick * DT * 1e9), pose, NOTHING if tick else AHEAD, None)
        tick += 1
        if explore.phase is Phase.BACK and before is Phase.ALIGN:
            starts.append(pose[0])
        yaw = pose[2] + turn * DT
        step = speed * DT * np.array([np.cos(yaw), np.sin(yaw)])
        stays = pose[0] + step[0] < low_m
        pose = np.array([*(pose[:2] if stays else pose[:2] + step), yaw])
        lowest = min(lowest, pose[0])
    assert low_m <= lowest < low_m + 0.01  # it went as far back as it could
    assert len(starts) == 5  # and still looked from all five directions
    assert np.ptp(starts) < 0.005  # each time from where it had begun


def test_being_stuck_on_the_way_forward_counts_as_an_obstacle():
    explore, still = Explore(CONTROL, 0), np.zeros(3)
    for tick in range(20):
        explore.command(round(tick * DT * 1e9), still, NOTHING, None)
    assert explore.phase is not Phase.FORWARD


def test_a_stroke_that_creeps_is_given_up():
    explore = Explore(CONTROL, 0)
    explore.command(0, np.zeros(3), AHEAD, None)
    explore.command(1, np.array([0.0, 0.0, np.deg2rad(-30)]), NOTHING, None)
    assert explore.phase is Phase.BACK
    for tick in range(round((CONTROL.give_up_s + 1) / DT)):
        creep = -0.01 * tick * DT  # a centimetre a second: 30 cm would take half a minute
        pose = np.array([creep * np.cos(-np.pi / 6), creep * np.sin(-np.pi / 6), -np.pi / 6])
        explore.command(round((tick + 1) * DT * 1e9), pose, NOTHING, None)
    assert explore.phase is Phase.FORTH


def test_without_recent_bits_it_stands_still_and_then_goes_on():
    explore = Explore(CONTROL, 0)
    for tick in range(100):
        assert explore.command(round(tick * DT * 1e9), np.zeros(3), None, None) == (0.0, 0.0)
    assert explore.command(round(100 * DT * 1e9), np.zeros(3), NOTHING, None) == (CONTROL.speed_m_s, 0.0)
    assert explore.phase is Phase.FORWARD


def test_the_same_seed_drives_the_same_way():
    ways = [[pose for _, pose, _, _ in run(Explore(CONTROL, seed), 90)] for seed in (1, 1, 2)]
    np.testing.assert_array_equal(ways[0], ways[1])
    assert np.abs(np.array(ways[0]) - ways[2]).max() > 0.1
