"""Free space along the way: a sensor that is silent at two poses in line says that it would be silent between them."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from llrp_online.configuration import RobotConfiguration
from llrp_online.learner import Learner
from replay.updates import Updates


class FreeSpaceLearner(Learner):
    """Learns from labels filled in between known negatives.

    Args:
        configuration: the robot's; its targets lie in line, all heading along it.
        reach_m: of every short-range sensor. Two silent poses no farther apart have seen all that lies between.
    """

    def __init__(self, configuration: RobotConfiguration, reach_m: float) -> None:
        super().__init__(configuration)
        self._along_m, self._reach_m = configuration.targets.build().poses[:, 0], reach_m

    def _remember(self, updates: Updates) -> None:
        labels, weight = filled(updates.labels, updates.weight, self._along_m, self._reach_m)
        super()._remember(replace(updates, labels=labels, weight=weight))


def filled(
    labels: NDArray[np.int8], weight: NDArray[np.float32], along_m: NDArray[np.float64], reach_m: float
) -> tuple[NDArray[np.int8], NDArray[np.float32]]:
    """Unknown labels whose nearest known neighbours on either side are 0 and within reach of each other become 0.

    Args:
        labels: (M, T, S) int8: 1, 0, -1 unknown.
        weight: (M, T, S) float32; what is filled in weighs as the lighter of its neighbours.
        along_m: (T,) ascending, where the targets lie.
        reach_m: of the sensors.

    Returns:
        New labels and weights.

    >>> bits = np.array([0, -1, 0, -1, 1, -1, 0], np.int8).reshape(1, 7, 1)
    >>> filled(bits, np.ones(bits.shape, np.float32), np.arange(7.0), 2.0)[0].ravel()
    array([ 0,  0,  0, -1,  1, -1,  0], dtype=int8)
    """
    count = len(along_m)
    places = np.arange(count)[None, :, None]
    known = labels >= 0
    before = np.maximum.accumulate(np.where(known, places, -1), axis=1)
    after = np.minimum.accumulate(np.where(known, places, count)[:, ::-1], axis=1)[:, ::-1]
    inside = ~known & (before >= 0) & (after < count)
    before, after = np.maximum(before, 0), np.minimum(after, count - 1)
    silent = (np.take_along_axis(labels, before, 1) == 0) & (np.take_along_axis(labels, after, 1) == 0)
    fill = inside & silent & (along_m[after] - along_m[before] <= reach_m + 1e-9)
    lighter = np.minimum(np.take_along_axis(weight, before, 1), np.take_along_axis(weight, after, 1))
    return np.where(fill, 0, labels).astype(np.int8), np.where(fill, lighter, weight)
