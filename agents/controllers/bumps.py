"""Where something stopped the wheels: what no picture showed is not to be run into again and again."""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from replay.poses import relative

Floats = NDArray[np.float64]

#: The rim that met it, ahead of the axle.
_RIM_M = 0.08
#: As wide as the body and something more, and as far ahead as leaves room to turn.
_BESIDE_M, _AHEAD_M = 0.09, 0.17
#: Odometry tells for so long where that was; and no more places than this are kept.
_KEPT_NS, _MOST = 240_000_000_000, 32


class Bumps:
    """Places that the robot was held at, by its odometry, for a while.

    >>> bumps = Bumps()
    >>> bumps.add(0, np.zeros(3))
    >>> bumps.ahead(0, np.zeros(3)), bumps.ahead(0, np.array([0.0, 0.0, np.pi])), bumps.ahead(10**12, np.zeros(3))
    (0.0, None, None)
    """

    def __init__(self) -> None:
        self._places: deque[tuple[int, float, float]] = deque(maxlen=_MOST)

    def add(self, t_ns: int, pose: Floats) -> None:
        """It is held here, at what is ahead."""
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        self._places.append((t_ns, float(pose[0] + _RIM_M * cos), float(pose[1] + _RIM_M * sin)))

    def ahead(self, t_ns: int, pose: Floats) -> float | None:
        """How far to the left of the way ahead the nearest place in that way lies [m]; None where there is none."""
        while self._places and t_ns - self._places[0][0] > _KEPT_NS:
            self._places.popleft()
        if not self._places:
            return None
        places = np.array([(x, y, 0.0) for _, x, y in self._places])
        seen = relative(pose, places)
        there = seen[(seen[:, 0] > 0) & (seen[:, 0] < _AHEAD_M) & (np.abs(seen[:, 1]) < _BESIDE_M)]
        return float(there[there[:, 0].argmin(), 1]) if len(there) else None
