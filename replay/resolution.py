"""A whole drive labelled at once: what the trajectory store would say of each frame at its end, from plain arrays.

For studies that label the same drive again and again, under other rules or other noise, and have it in memory.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from replay.compiled_labels import Solvers
from replay.poses import Floats
from replay.rule import LabelRule, OdometryLimits
from replay.solver import Solver, Store
from replay.targets import Targets
from replay.track import EARLIEST_NS, LATEST_NS, Settled
from replay.uncertainty import StepNoise

#: Frames resolved together: few enough for their columns to stay in the processor's cache, however long the drive.
_AT_ONCE = 256


class Drive(NamedTuple):
    """Each part in order of its time.

    Attributes:
        odometry_ns: (N,) int64, all different.
        poses: (N, 3) float64 `[x_m, y_m, yaw_rad]`.
        covariances: (N, 3, 3) accumulated; None where the robot gives none.
        readings_ns: (M,) int64.
        stream: (M,) int64, which stream of sensors spoke.
        bits: (M, sensors of the widest stream) int8: 1, 0, -1 unknown.
        frames_ns: (F,) int64.
    """

    odometry_ns: NDArray[np.int64]
    poses: Floats
    covariances: Floats | None
    readings_ns: NDArray[np.int64]
    stream: NDArray[np.int64]
    bits: NDArray[np.int8]
    frames_ns: NDArray[np.int64]


class Labels(NamedTuple):
    """Of F frames.

    Attributes:
        labels: (F, T, S) int8: 1, 0, -1 unknown.
        weight: (F, T, S) float32 in [0, 1]; 0 where unknown.
        posed: (F,) bool: odometry told where the frame was taken.
        apart_s: (F, streams, T) float32: time between the frame and the reading that labels the target; NaN where none
            does.
    """

    labels: NDArray[np.int8]
    weight: NDArray[np.float32]
    posed: NDArray[np.bool_]
    apart_s: NDArray[np.float32]


def resolve(
    drive: Drive,
    targets: Targets,
    streams: Sequence[Sequence[int]],
    rule: LabelRule,
    limits: OdometryLimits,
    noise: StepNoise | None = None,
) -> Labels:
    """The labels of all frames; arguments as `TrajectoryStore` has them.

    >>> still = Drive(np.array([0, 1]), np.zeros((2, 3)), None, np.array([1]), np.array([0]),
    ...               np.ones((1, 1), np.int8), np.array([0]))
    >>> resolve(still, Targets.line(0.0, 0.1, 0.1), [[0]], LabelRule(0.02), OdometryLimits()).labels[:, :, 0]
    array([[ 1, -1]], dtype=int8)
    """
    store, solver = placed(drive, targets, streams, rule, limits, noise)
    return _joined([_some(store, solver, drive.frames_ns[at : at + _AT_ONCE]) for at in _starts(len(drive.frames_ns))])


def placed(
    drive: Drive,
    targets: Targets,
    streams: Sequence[Sequence[int]],
    rule: LabelRule,
    limits: OdometryLimits,
    noise: StepNoise | None = None,
) -> tuple[Store, Solver]:
    """A store that holds the drive's odometry and its readings, each where the robot was, and no frame yet."""
    store = Store.empty(targets, streams, rule, limits, noise)
    covariances = [None] * len(drive.poses) if drive.covariances is None else drive.covariances
    for t_ns, pose, covariance in zip(drive.odometry_ns.tolist(), drive.poses.tolist(), covariances, strict=True):
        store.track.add(t_ns, pose, covariance)
    rows = store.readings.extend(drive.readings_ns)
    store.readings.columns.stream[rows], store.readings.columns.bits[rows] = drive.stream, drive.bits
    solver = Solvers(store).now
    solver.take_odometry(Settled(EARLIEST_NS, LATEST_NS, late=True, rejoined=True))
    return store, solver


def _starts(frames: int) -> range:
    """Where each lot of frames begins; one lot at least."""
    return range(0, max(frames, 1), _AT_ONCE)


def _some(store: Store, solver: Solver, frames_ns: NDArray[np.int64]) -> Labels:
    """The labels of frames that only now come into the store, and leave it."""
    rows = store.frames.extend(frames_ns)
    store.frames.columns.frame_id[rows] = np.arange(len(frames_ns))
    solver.take_frames(rows.start, rows.stop)
    frames, live = store.frames.columns, slice(rows.start, rows.stop)
    apart_s = (np.abs(frames.best_t_ns[live] - frames_ns[:, None, None]) * 1e-9).astype(np.float32)
    apart_s[~np.isfinite(frames.best[live])] = np.nan
    found = solver.collect(rows.stop, only_closed=True)
    store.frames.clear()
    return Labels(found.labels, found.weight, found.posed, apart_s)


def _joined(parts: list[Labels]) -> Labels:
    return Labels(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
