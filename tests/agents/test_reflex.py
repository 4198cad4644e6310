"""The proximity reflex."""

import numpy as np
import pytest

from agents.controllers.reflex import Reflex
from llrp_online.configuration.running import Control

CONTROL = Control()
AHEAD, LEFT, RIGHT = (CONTROL.speed_m_s, 0.0), (0.0, CONTROL.turn_rad_s), (0.0, -CONTROL.turn_rad_s)


def feel(controller, *bits):
    return controller.command(0, np.zeros(3), np.array(bits, np.int8) if bits else None, None)


@pytest.mark.parametrize(
    ("bits", "expected"),
    [
        ((0, 0, 0, 0, 0), AHEAD),
        ((-1, 0, 0, 0, -1), AHEAD),
        ((1, 0, 0, 0, 0), RIGHT),
        ((0, 0, 0, 1, 0), LEFT),
        ((0, 0, 1, 0, 0), RIGHT),
        ((1, 0, 0, 1, 1), LEFT),
    ],
)
def test_it_turns_away_from_what_it_feels(bits, expected):
    assert feel(Reflex(CONTROL), *bits) == expected


def test_it_keeps_turning_one_way_until_it_feels_nothing():
    reflex = Reflex(CONTROL)
    assert feel(reflex, 1, 0, 0, 0, 0) == RIGHT
    assert feel(reflex, 0, 0, 0, 0, 1) == RIGHT
    assert feel(reflex, 0, 0, 0, 0, 0) == AHEAD
    assert feel(reflex, 0, 0, 0, 0, 1) == LEFT


def test_without_recent_readings_it_stands_still():
    assert feel(Reflex(CONTROL)) == (0.0, 0.0)
