"""The rig's mirror image: what takes whose place when left and right swap."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_Indices = NDArray[np.int64]


class Mirror(NamedTuple):
    """Who replaces each in a flipped world. Its own inverse.

    Attributes:
        targets: (T,) which target.
        sensors: (S,) which sensor.
        cameras: (C / 3,) which camera.

    >>> Mirror(np.array([0]), np.array([0]), np.array([1, 0])).channels
    array([3, 4, 5, 0, 1, 2])
    """

    targets: _Indices
    sensors: _Indices
    cameras: _Indices

    @property
    def channels(self) -> _Indices:
        """(C,) which channel of a picture replaces each."""
        return (3 * self.cameras[:, None] + np.arange(3)).ravel()
