"""Trials that drive: on true clearance, on weights, while learning; and the controller that approaches on purpose."""

from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from agents.controllers.curious import Curious
from agents.experiments.drives import Drive
from agents.experiments.driving import driving, living
from agents.experiments.learning import Start
from agents.experiments.settings import configuration_of, robot_of, scenario
from llrp_online.configuration.running import Control

USUAL = configuration_of("thymio")


def test_an_oracle_goes_far_and_seldom_touches_anything(tmp_path: Path) -> None:
    told = driving(Drive(robot_of(USUAL), scenario("tiles"), 2001, 1.0, "avoid"), sight="truth").run(tmp_path)
    blind = driving(Drive(robot_of(USUAL), scenario("tiles"), 2001, 1.0, "blind")).run(tmp_path)
    assert told["collisions"] < blind["collisions"]
    assert told["metres"] > 2


@pytest.mark.slow
def test_a_drive_while_learning_counts_each_minute_and_repeats_itself(tmp_path: Path) -> None:
    robot, arena = robot_of(USUAL), scenario("tiles")
    start = asdict(Start(USUAL.model_dump(mode="json"), [Drive(robot, arena, 0, 0.2)]))
    drive = Drive(USUAL.model_dump(mode="json"), arena, 0, 1.0, "curious")
    trial = living(drive, start, [Drive(robot, arena, 1000, 0.2)])
    told = trial.run(tmp_path)
    (minute,) = told["minutes"]
    assert minute["known_labels"] > minute["positive_labels"] >= 0
    assert minute["metres"] > 0
    assert trial.run(tmp_path) == told


class _Says:
    """A controller that always says the same."""

    def __init__(self, speed: float) -> None:
        self._speed = speed

    def command(self, *_: object) -> tuple[float, float]:
        return self._speed, 0.0


def _speeds(approaches: float, felt_at_s: float, seconds: int) -> list[float]:
    curious = Curious(Control(approaches_per_minute=approaches), _Says(1.0), _Says(2.0))
    nothing, something = np.zeros(5, np.int8), np.ones(5, np.int8)
    return [
        curious.command(t * 10**9, np.zeros(3), something if t == felt_at_s else nothing, None)[0]
        for t in range(seconds)
    ]


def test_an_approach_lasts_until_what_was_felt_is_left_again() -> None:
    assert _speeds(2.0, 33, 40) == [1.0] * 30 + [2.0] * 4 + [1.0] * 6


def test_an_approach_that_meets_nothing_ends() -> None:
    speeds = _speeds(2.0, -1, 45)
    assert speeds[30:39] == [2.0] * 9
    assert speeds[39:] == [1.0] * 6


def test_without_a_budget_it_never_approaches() -> None:
    assert set(_speeds(0.0, 10, 200)) == {1.0}
