"""Places felt twice: what a robot that does not know where it truly was can tell of its own labels.

A label says that a reading and a target lay at one place, though time passed between. Where the robot comes back to a
place and feels the same, odometry has held so long; where it feels something else, the two were not one place (or the
edge of something runs through it). So pairs of readings stand in for the truth: the correlation of their bits is what
test theory calls the reliability of a label of that age.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from replay.columns import Readings
from replay.poses import Floats, wrap
from replay.resolution import Drive, placed
from replay.rule import LabelRule, OdometryLimits
from replay.targets import Targets
from replay.uncertainty import StepNoise, axes, relative_covariance

#: Readings held against all later ones of their stream; as many are drawn evenly from a longer drive.
_ANCHORS = 4000
_AT_ONCE = 128


class Sightings(NamedTuple):
    """Of P pairs of readings.

    Attributes:
        apart_s: (P,) float64, time between the two.
        deviation_m: (P,) float64, how well odometry says it knows the one's position from the other's: the standard
            deviation along the longest axis.
        first: (P, sensors of the widest stream) int8: what was felt first, 1, 0 or -1 unknown.
        again: (P, sensors of the widest stream) int8: and when the robot came back.
    """

    apart_s: Floats
    deviation_m: Floats
    first: NDArray[np.int8]
    again: NDArray[np.int8]


def sightings(
    drive: Drive, streams: Sequence[Sequence[int]], rule: LabelRule, limits: OdometryLimits, noise: StepNoise
) -> Sightings:
    """Every later visit to the place of a reading: the nearest reading of that visit, if the rule's tolerances allow.

    A visit ends when the robot, by its odometry, is farther from the place than a tolerance: what is felt while it
    stays is no second time. Arguments as `replay.resolution.resolve` has them; the rule's window does not count.

    >>> t_ns = np.arange(5) * 1_000_000_000
    >>> there_and_back = np.array([[x, 0.0, 0.0] for x in (0.0, 0.1, 0.2, 0.1, 0.0)])
    >>> bits = np.array([[0], [0], [1], [1], [0]], np.int8)
    >>> drive = Drive(t_ns, there_and_back, None, t_ns, np.zeros(5, np.int64), bits, t_ns)
    >>> found = sightings(drive, [[0]], LabelRule(0.02), OdometryLimits(max_gap_s=2.0), lambda x, y, turn: (0.0,) * 4)
    >>> found.apart_s.tolist(), found.first.ravel().tolist(), found.again.ravel().tolist()
    ([4.0, 2.0], [0, 0], [0, 1])
    """
    store, _ = placed(drive, Targets.listed([[0.0, 0.0, 0.0]]), streams, replace(rule, window="drift"), limits, noise)
    readings = store.readings.live
    first, again = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
    for stream in range(len(streams)):
        rows = np.flatnonzero((readings.stream == stream) & (readings.trajectory >= 0))
        anchors = np.arange(0, len(rows), max(1, -(-len(rows) // _ANCHORS)))
        for at in range(0, len(anchors), _AT_ONCE):
            some, later = _revisits(readings, rows, anchors[at : at + _AT_ONCE], rule)
            first.append(some)
            again.append(later)
    one, two = np.concatenate(first), np.concatenate(again)
    position = np.stack([readings.x_m[two], readings.y_m[two]], -1)
    covariance, _ = relative_covariance(readings.sums[one], readings.sums[two], position)
    apart_s = (readings.t_ns[two] - readings.t_ns[one]).astype(np.float64) * 1e-9
    return Sightings(apart_s, axes(covariance)[0], readings.bits[one], readings.bits[two])


def _revisits(
    readings: Readings, rows: NDArray[np.int64], anchors: NDArray[np.int64], rule: LabelRule
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows of readings, and for each the row that felt its place again; `anchors` count among `rows` of one stream."""
    begin = int(anchors[0])  # nothing earlier is a later visit
    here = rows[begin:]
    x, y, yaw = readings.x_m[here], readings.y_m[here], readings.yaw_rad[here]
    own = anchors - begin
    apart: Floats = np.hypot(x - x[own, None], y - y[own, None])
    near = (apart <= rule.position_tolerance_m) & (readings.trajectory[here] == readings.trajectory[here[own], None])
    if rule.heading_tolerance_rad is not None:
        near &= np.abs(wrap(yaw - yaw[own, None])) <= rule.heading_tolerance_rad
    came = near & ~np.pad(near, ((0, 0), (1, 0)))[:, :-1]
    visit = came.cumsum(1)
    later = near & (visit > np.take_along_axis(visit, own[:, None], 1)) & (np.arange(len(here)) > own[:, None])
    which, column = np.nonzero(later)
    number = visit[which, column]
    order = np.lexsort((column, apart[which, column], number, which))
    which, column, number = which[order], column[order], number[order]
    nearest = np.ones(len(which), np.bool_)
    nearest[1:] = (which[1:] != which[:-1]) | (number[1:] != number[:-1])
    return here[own][which[nearest]], here[column[nearest]]
