"""Random turning."""

import numpy as np

from agents.controllers.blind import STRAIGHT_S, TURN_S, Blind
from llrp_online.configuration.running import Control

CONTROL = Control()
TICK_NS = 50_000_000


def drive(seed, seconds=120, bits=None):
    blind = Blind(CONTROL, seed)
    return [blind.command(i * TICK_NS, np.zeros(3), bits, None) for i in range(seconds * 20)]


def stretches(commands):
    """Each command with how long it lasted [s], without the last, which was cut off."""
    found = []
    for command in commands:
        if not found or found[-1][0] != command:
            found.append([command, 0.0])
        found[-1][1] += TICK_NS * 1e-9
    return found[:-1]


def test_it_goes_straight_and_turns_by_turns_for_random_times():
    found = stretches(drive(0))
    assert [turn != 0 for (_, turn), _ in found] == [i % 2 == 1 for i in range(len(found))]
    assert {speed for (speed, turn), _ in found if turn == 0} == {CONTROL.speed_m_s}
    assert {turn for (_, turn), _ in found if turn} == {CONTROL.turn_rad_s, -CONTROL.turn_rad_s}
    for (_, turn), lasted_s in found:
        low_s, high_s = TURN_S if turn else STRAIGHT_S
        assert low_s - 0.06 <= lasted_s <= high_s + 0.06
    assert len({round(lasted_s, 3) for _, lasted_s in found}) > 10


def test_it_depends_on_its_seed_and_on_nothing_it_could_feel():
    assert drive(1) == drive(1) == drive(1, bits=np.ones(5, np.int8))
    assert drive(1) != drive(2)
