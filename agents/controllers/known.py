"""A coarse map of what a drive knows: how often it came through each place, in which direction, and what is solid.

In the frame of odometry, which drifts: solid places are forgotten after a while. What was driven through stays known,
as the pictures taken there do, wherever odometry has moved to since.
"""

import math
from collections import Counter

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Place = tuple[int, int]

CELL_M = 0.1
OCTANTS = 8  # of directions: lines an octant apart see a thing from another side
SIGHT_M = 1.0  # a line is worth what lies on it, so far
SHORTEST_M = 0.2  # shorter runs label few distances
REMEMBER_S = 180.0
PLACE_WORTH, LINE_WORTH = 1.0, 0.5  # of a cell never entered, of a cell never crossed in this direction
TURN_COST_PER_RAD = 1.0  # while it turns, it learns little
TOO_SHORT = 10.0  # costs more than any line is worth


class Known:
    """The map.

    >>> known, here = Known(), np.zeros(3)
    >>> new = known.novelty(0, here, 0.0)
    >>> known.drove(np.array([0.55, 0.0, 0.0]))
    >>> known.novelty(0, here, 0.0) < new
    True
    """

    def __init__(self) -> None:
        self._entered: Counter[Place] = Counter()
        self._crossed: Counter[tuple[int, int, int]] = Counter()
        self._solid_ns: dict[Place, int] = {}
        self._last: tuple[int, int, int] | None = None

    def drove(self, pose: Floats) -> None:
        """The robot is here, (3,) [x_m, y_m, yaw_rad]; counted once until it enters another cell or turns."""
        x_m, y_m, yaw_rad = pose.tolist()
        place = _place(x_m, y_m)
        now = (*place, _octant(yaw_rad))
        if now == self._last:
            return
        self._last = now
        self._entered[place] += 1
        self._crossed[now] += 1
        self._solid_ns.pop(place, None)

    def met(self, t_ns: int, pose: Floats, ahead_m: float) -> None:
        """Something stands so far ahead of the pose."""
        x_m, y_m, yaw_rad = pose.tolist()
        self._solid_ns[_place(x_m + ahead_m * math.cos(yaw_rad), y_m + ahead_m * math.sin(yaw_rad))] = t_ns

    def novelty(self, t_ns: int, pose: Floats, heading_rad: float) -> float:
        """What a run from the pose along a heading would be worth: new places and lines, less the turn."""
        x_m, y_m, yaw_rad = pose.tolist()
        ahead_x, ahead_y, octant = math.cos(heading_rad), math.sin(heading_rad), _octant(heading_rad)
        worth = -TURN_COST_PER_RAD * abs(math.remainder(heading_rad - yaw_rad, math.tau))
        for step in range(1, round(SIGHT_M / CELL_M) + 1):
            way_m = step * CELL_M
            place = _place(x_m + way_m * ahead_x, y_m + way_m * ahead_y)
            if self._is_solid(place, t_ns):
                return worth - (TOO_SHORT if way_m < SHORTEST_M else 0.0)
            worth += PLACE_WORTH / (1 + self._entered[place]) + LINE_WORTH / (1 + self._crossed[*place, octant])
        return worth

    def _is_solid(self, place: Place, t_ns: int) -> bool:
        met_ns = self._solid_ns.get(place)
        return met_ns is not None and t_ns - met_ns < REMEMBER_S * 1e9


def _place(x_m: float, y_m: float) -> Place:
    return math.floor(x_m / CELL_M), math.floor(y_m / CELL_M)


def _octant(heading_rad: float) -> int:
    return round(heading_rad * OCTANTS / math.tau) % OCTANTS
