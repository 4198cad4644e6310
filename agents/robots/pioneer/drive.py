"""The drive: on and on over one map, in virtual time, until it nears the edge and begins anew in the middle."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agents.robots.pioneer.world import DriveTable

#: Time zero is what a message with an unset stamp says.
START_NS = 1_000_000_000


class Step(NamedTuple):
    """Where the robot is at one moment.

    Attributes:
        t_ns: the sensors' time.
        pose: (3,) float64 [x_m, y_m, yaw_rad] on the map.
        trajectory: counts up from 0: a new one begins in the middle.
    """

    t_ns: int
    pose: NDArray[np.float64]
    trajectory: int


def drive(settings: DriveTable, half_m: float, seconds: float, seed: int) -> Iterator[Step]:
    """The moments of one drive, each an exact arc after the one before.

    Args:
        settings: speeds and rates.
        half_m: from the middle of the map to its edge.
        seconds: of the sensors' time.
        seed: of headings in the middle and of angular speeds.
    """
    if settings.margin_m >= half_m:
        raise ValueError(f"drive.margin_m: expected less than {half_m:g} m, half the map, got {settings.margin_m:g}")
    rng = np.random.default_rng(seed)
    ticks_a_turn = round(settings.turn_every_s * settings.rate_hz)
    x_m, y_m, yaw_rad, turn_rad, trajectory = 0.0, 0.0, rng.uniform(-math.pi, math.pi), 0.0, 0
    way_m = settings.speed_m_s / settings.rate_hz
    for tick in range(round(seconds * settings.rate_hz)):
        yield Step(START_NS + round(tick * 1e9 / settings.rate_hz), np.array([x_m, y_m, yaw_rad]), trajectory)
        if tick % ticks_a_turn == 0:
            limit = math.radians(settings.turn_deg_s) / settings.rate_hz
            turn_rad = rng.uniform(-limit, limit)
        chord_m = way_m * (math.sin(turn_rad / 2) / (turn_rad / 2) if turn_rad else 1.0)
        x_m += chord_m * math.cos(yaw_rad + turn_rad / 2)
        y_m += chord_m * math.sin(yaw_rad + turn_rad / 2)
        yaw_rad = math.remainder(yaw_rad + turn_rad, 2 * math.pi)
        if max(abs(x_m), abs(y_m)) > half_m - settings.margin_m:
            x_m, y_m, yaw_rad, trajectory = 0.0, 0.0, rng.uniform(-math.pi, math.pi), trajectory + 1
