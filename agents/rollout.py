"""One robot, one controller, one process, virtual time: the way of a recording that is the same bytes every time.

Sensors become bits by the configuration's thresholds, bits a command, the command the next tick. No wire in between, so
nothing depends on how fast the machine is; `llrp demo` runs the same parts as processes of their own.
"""

import re
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from agents.controllers import Controller
from agents.robots.simulated import Observation, SimulatedRobot
from llrp_online.configuration import RobotConfiguration
from llrp_online.configuration.rig import ShortRange
from llrp_online.predictor import Predictor


class RangeBits:
    """The ranges of one LaserScan, made into the configuration's bits.

    >>> left = ShortRange(name="left", field="ranges[1]", below=0.1)
    >>> right = ShortRange(name="right", field="ranges[0]", below=0.1)
    >>> RangeBits([left, right])(np.array([0.05, np.inf]))
    array([0, 1], dtype=int8)
    """

    def __init__(self, sensors: list[ShortRange]) -> None:
        self._index = np.array([_index(sensor) for sensor in sensors])
        self._is_below = np.array([sensor.below is not None for sensor in sensors])
        limits = [sensor.above if sensor.below is None else sensor.below for sensor in sensors]
        self._limit = np.array(limits, np.float64)

    def __call__(self, ranges: NDArray[np.float64]) -> NDArray[np.int8]:
        """(S,) int8 in the configuration's order: 1, 0, or -1 where the range is NaN."""
        value = ranges[self._index]
        bits = np.where(self._is_below, value < self._limit, value > self._limit).astype(np.int8)
        return np.where(np.isnan(value), np.int8(-1), bits)


def rollout(
    robot: SimulatedRobot,
    controller: Controller,
    configuration: RobotConfiguration,
    seconds: float,
    perceive: Callable[[Observation], NDArray[np.float32] | None] | None = None,
) -> Iterator[Observation]:
    """Drive for `seconds` of sensor time, yielding every tick. The first tick stands still: nothing is known yet.

    With `perceive` the controller is given what that says of the newest tick with a picture, (T, S); see `seen_by`.
    """
    rate_hz = configuration.simulated().rate_hz
    bits_of = RangeBits(configuration.short_range)
    command, prediction = (0.0, 0.0), None
    for _ in range(round(seconds * rate_hz)):
        seen = robot.step(*command)
        yield seen
        if perceive is not None and seen.picture is not None:
            prediction = perceive(seen)
        command = controller.command(seen.t_ns, seen.odometry, bits_of(seen.ranges), prediction)


def seen_by(predictor: Predictor) -> Callable[[Observation], NDArray[np.float32] | None]:
    """What a predictor says of each picture; None before it has weights."""

    def perceive(seen: Observation) -> NDArray[np.float32] | None:
        if seen.picture is None or predictor.version is None:
            return None
        return predictor.predict(seen.picture).probabilities

    return perceive


def _index(sensor: ShortRange) -> int:
    match = re.fullmatch(r"ranges\[(\d+)\]", sensor.field)
    if match is None:
        raise ValueError(
            f"short_range {sensor.name!r}: field = {sensor.field!r}, but the simulated robot gives a LaserScan; "
            f"expected `ranges[0]` (rightmost) and so on"
        )
    return int(match.group(1))
