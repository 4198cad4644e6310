"""What a real camera adds to a sharp picture: an open shutter smears what moves, a lens out of focus blurs all.

Both work on finished pictures, where what is brighter than white was cut off already; and with sums whose order is
fixed, so that the same pictures come out everywhere.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from replay.poses import wrap

Floats = NDArray[np.float64]
Picture = NDArray[np.uint8]

SMEARED_OVER = 8  # pictures that an open shutter sees; in the fastest turn, at 20 Hz, half a pixel apart
REACH_SIGMAS = 3  # a Gaussian ends here


def way(before: Floats, now: Floats, share: float) -> Iterator[Floats]:
    """Poses (3,) along the last `share` of the way from `before` to `now`, evenly, `now` the last.

    >>> [pose.tolist() for pose in way(np.zeros(3), np.array([0.8, 0.0, 0.0]), 0.5)][::7]
    [[0.45, 0.0, 0.0], [0.8, 0.0, 0.0]]
    """
    step = now - before
    step[2] = wrap(step[2])
    for index in range(1, SMEARED_OVER + 1):
        yield now - share * (1 - index / SMEARED_OVER) * step


def smeared(pictures: Sequence[Picture]) -> Picture:
    """The mean of pictures (H, W, 3) uint8, rounded."""
    total = np.stack(pictures).sum(0, np.int64)
    return ((total + len(pictures) // 2) // len(pictures)).astype(np.uint8)


def blurred(picture: Picture, sigma_px: float) -> Picture:
    """(H, W, 3) uint8 under a Gaussian of this deviation; beyond its edges the picture goes on as at the edge.

    >>> dot = np.zeros((1, 5, 3), np.uint8)
    >>> dot[0, 2] = 255
    >>> blurred(dot, 0.5)[0, :, 0].tolist()
    [0, 27, 201, 27, 0]
    """
    reach = math.ceil(REACH_SIGMAS * sigma_px)
    weights = [math.exp(-(offset**2) / (2 * sigma_px**2)) for offset in range(-reach, reach + 1)]
    total, soft = sum(weights), picture.astype(np.float64)
    for axis in (0, 1):
        count = soft.shape[axis]
        padded = np.pad(soft, [(reach, reach) if axis == along else (0, 0) for along in range(3)], mode="edge")
        soft = np.zeros_like(soft)
        for first, weight in enumerate(weights):
            soft += weight / total * padded.take(range(first, first + count), axis)
    return np.rint(soft).astype(np.uint8)
