"""Proximity: from what the infrared sensors say to metres, right to left as a LaserScan has them.

They measure how much light comes back: much from near, little from far, nothing from beyond some 14 cm. The curve is
the makers' own, from their simulator Enki: a value `v` means `half_m * sqrt(peak / v - 1)`. It is a white surface's;
black ones give less light, and so seem farther away.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from llrp_online.configuration import Thymio

#: The outermost beams; the five are evenly spaced between them.
ANGLES_RAD = (-math.radians(40), math.radians(40))
REACH_M = 0.14


def ranges_m(values: Sequence[int], calibration: Thymio) -> NDArray[np.float64]:
    """(S,) float64 [m], rightmost first, of values left to right; inf where nothing is felt.

    >>> ranges_m([0, 0, 2252, 4505, 0], Thymio()).round(3).tolist()
    [inf, 0.0, 0.085, inf, inf]
    """
    light = np.array(values[::-1], np.float64)
    with np.errstate(divide="ignore"):
        return calibration.proximity_half_m * np.sqrt(np.maximum(calibration.proximity_peak / light - 1, 0.0))


def half_m(distance_m: float, value: float, peak: float) -> float:
    """The `proximity_half_m` with which a value means that distance; ValueError where no curve goes there.

    >>> round(half_m(0.10, 1900, 4505), 4)
    0.0854
    """
    if not 0 < value < peak or not distance_m > 0:
        raise ValueError(
            f"proximity: a value of {value:g} at {distance_m:g} m: expected one between 0 and {peak:g}: hold something "
            "white exactly so far before the middle sensor"
        )
    return distance_m / math.sqrt(peak / value - 1)
