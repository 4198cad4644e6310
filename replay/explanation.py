"""Why a frame's labels are what they are: which reading gave each, when, how far off, and how well odometry knew it.

It reads what the label rule has settled in a store's columns, and decides nothing anew: so it agrees with the labels.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from replay.columns import Samples
from replay.labels import UNKNOWN
from replay.poses import Floats, relative, wrap
from replay.solver import Store
from replay.uncertainty import SUMS, StepNoise, axes, relative_covariance, step_sums

Whole = NDArray[np.int64]


class Explanation(NamedTuple):
    """Of one frame. What is of a reading means nothing where `reading_ns` is -1: no reading lay within tolerance.

    Attributes:
        t_ns: the frame's time.
        pose: (3,) `[x_m, y_m, yaw_rad]` of the robot then; None where odometry does not tell.
        labels: (T, S) int8: 1, 0, -1 unknown. A reading that lacks a bit leaves it unknown, too.
        weight: (T, S) float32 in [0, 1]; 0 where unknown.
        reading_ns: (T, S) int64, when the reading was taken that speaks for the target; -1: there is none.
        distance_m: (T, S) float64, how far from the target.
        turned_rad: (T, S) float64, how far its heading is from the target's.
        deviation_m: (T, S) float64, how well odometry knows the reading's position from the frame's: the standard
            deviation along the longest axis; NaN where nobody says how much odometry errs.
        heading_deviation_rad: (T, S) float64, the same of its heading.
    """

    t_ns: int
    pose: Floats | None
    labels: NDArray[np.int8]
    weight: NDArray[np.float32]
    reading_ns: Whole
    distance_m: Floats
    turned_rad: Floats
    deviation_m: Floats
    heading_deviation_rad: Floats

    def as_json(self) -> dict[str, Any]:
        """The same in plain lists, None where there is nothing."""
        none = self.reading_ns < 0
        plain = {name: _plain(getattr(self, name), none) for name in self._fields[4:]}
        pose = None if self.pose is None else self.pose.tolist()
        known = np.round(self.weight.astype(np.float64), 6)
        return {"t_ns": self.t_ns, "pose": pose, "labels": self.labels.tolist(), "weight": known.tolist(), **plain}


def explain(store: Store, row: int, noise: StepNoise | None) -> Explanation:
    """Explain the frame at this row; `noise` of odometry steps for which the robot gives no covariance."""
    frames = store.frames.columns
    sensors, targets = frames.labels.shape[2], len(store.places.x_m)
    t_ns, posed = int(frames.t_ns[row]), bool(frames.trajectory[row] >= 0)
    _, labels, weight = labels_at(store, row)
    when = np.full((targets, sensors), -1, np.int64)
    numbers = np.full((4, targets, sensors), np.nan)
    pose = _pose(frames, np.array([row]))[0] if posed else None
    if posed:
        stream, target = np.nonzero(np.isfinite(frames.best[row]))
        rows = _reading_rows(store, frames.best_t_ns[row, stream, target], stream)
        readings = store.readings.columns
        off = relative(_pose(frames, np.array([row])), _pose(readings, rows)) - _targets(store, target)
        off[:, 2] = wrap(off[:, 2])
        found = np.stack([frames.best[row, stream, target], off[:, 2], *_deviations(store, t_ns, rows, noise)])
        for place in range(store.places.sensors.shape[1]):
            sensor = store.places.sensors[stream, place]
            speaks = sensor >= 0
            when[target[speaks], sensor[speaks]] = readings.t_ns[rows[speaks]]
            numbers[:, target[speaks], sensor[speaks]] = found[:, speaks]
    return Explanation(t_ns, pose, labels, weight, when, *numbers)


def labels_at(store: Store, row: int) -> tuple[int, NDArray[np.int8], NDArray[np.float32]]:
    """Id, labels (T, S) and weights (T, S) of the frame at this row, so far."""
    frames = store.frames.columns
    labels = frames.labels[row].copy()
    drift = frames.weight.shape[1] > 0
    weight = frames.weight[row].copy() if drift else (labels != UNKNOWN).astype(np.float32)
    return int(frames.frame_id[row]), labels, weight


def _pose(columns: Any, rows: Whole) -> Floats:
    return np.stack([columns.x_m[rows], columns.y_m[rows], columns.yaw_rad[rows]], -1)


def _targets(store: Store, target: Whole) -> Floats:
    places = store.places
    return np.stack([places.x_m[target], places.y_m[target], places.yaw_rad[target]], -1)


def _reading_rows(store: Store, times: Whole, streams: Whole) -> Whole:
    """The row of each reading, by its time and its stream: the two name it."""
    found: list[int] = []
    for t_ns, stream in zip(times.tolist(), streams.tolist(), strict=True):
        at = store.readings.at(t_ns)
        here = store.readings.columns.stream[at]
        found.append(at.start + int(np.flatnonzero(here == stream)[0]))
    return np.array(found, np.int64)


def _deviations(store: Store, frame_ns: int, rows: Whole, noise: StepNoise | None) -> tuple[Floats, Floats]:
    """Standard deviations of the readings' positions (longest axis) and headings, as seen from the frame: (M,) each."""
    blank = np.full(len(rows), np.nan)
    if noise is None or not len(rows):
        return blank, blank
    readings = store.readings.columns
    times = np.append(readings.t_ns[rows], frame_ns)
    first, last = store.track.from_ns(int(times.min()) + 1) - 1, store.track.from_ns(int(times.max()))
    sums = _sums_at(store.track.columns, first, last, times, noise)
    position = _pose(readings, rows)[:, :2]
    covariance, heading = relative_covariance(np.broadcast_to(sums[-1:], sums[:-1].shape), sums[:-1], position)
    return axes(covariance)[0], np.sqrt(heading)


def _sums_at(samples: Samples, first: int, last: int, times: Whole, noise: StepNoise) -> Floats:
    """The sums of `replay.uncertainty` at these times, counted from the sample at row `first` up to that at `last`."""
    poses = _pose(samples, np.arange(first, last + 1)).tolist()
    given = [samples.covariance[at] if samples.given[at] else None for at in range(first, last + 1)]
    sums = np.zeros((len(poses), SUMS))
    for at in range(1, len(poses)):
        sums[at] = step_sums(poses[at - 1], poses[at], noise, given[at - 1], given[at])
    np.cumsum(sums, 0, out=sums)
    sample_ns = samples.t_ns[first : last + 1]
    after = np.searchsorted(sample_ns, times, "left")
    before = np.where(sample_ns[after] == times, after, after - 1)
    span = np.maximum(sample_ns[after] - sample_ns[before], 1)
    share = ((times - sample_ns[before]) / span)[:, None]
    return sums[before] + share * (sums[after] - sums[before])


def _plain(values: NDArray[Any], none: NDArray[np.bool_]) -> list[list[float | None]]:
    blank = none | (np.isnan(values) if values.dtype.kind == "f" else False)
    return [
        [None if nothing else value for value, nothing in zip(*pair, strict=True)]
        for pair in zip(values.tolist(), blank.tolist(), strict=True)
    ]
