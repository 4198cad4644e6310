"""The label rule: which reading labels which target of which frame.

For a frame and a reading in its window, the reading's pose is expressed in the frame's pose. For each target the
candidates are the readings whose heading differs from the target's by at most the tolerance; the nearest in position
wins, ties by the smaller time between, then the earlier; its bits are the labels if it lies within the position
tolerance. (Nava et al. 2019, section III, "self-supervised label generation".)

This is the rule in numpy, the reference for `replay.label_kernels`. Where a comparison decides, both compute its two
sides with the same operations in the same order.
"""

import math

import numpy as np
from numpy.typing import NDArray

from replay.columns import Frames, Readings
from replay.poses import Floats, interpolate, wrap
from replay.ring import Ring
from replay.solver import Collected, Store
from replay.track import Settled
from replay.uncertainty import axes, relative_covariance, within_angle, within_disc

UNKNOWN = -1
_Rows = NDArray[np.int64]


class Reference:
    """See `replay.solver.Solver`."""

    def __init__(self, store: Store) -> None:
        self._track, self._readings, self._frames, self._places = store
        self._drift = self._frames.columns.sums.shape[1] > 0  # the columns grow, their shape but for rows stays

    def take_reading(self, row: int) -> bool:
        """One reading."""
        self._place(self._readings, np.array([row]))
        return self._offer(row)

    def take_frames(self, first: int, last: int) -> bool:
        """Some frames."""
        frames, rows = self._frames.columns, np.arange(first, last)
        self._place(self._frames, rows)
        for row in rows.tolist():
            self._resolve(row)
        frames.told[rows] = False
        frames.changed[rows] = frames.trajectory[rows] >= 0
        return bool(frames.changed[rows].any())

    def take_odometry(self, settled: Settled) -> bool:
        """One sample of odometry."""
        frames, readings = self._frames.columns, self._readings.columns
        before_ns, after_ns = settled.before_ns, settled.after_ns
        if settled.rejoined:
            moved, stale = _all(self._readings), _all(self._frames)
        else:
            moved, stale = (_inside(ring, before_ns, after_ns) for ring in (self._readings, self._frames))
        if settled.late and not settled.rejoined:
            # What a reading labels whose pose is now another must look for its nearest afresh.
            every = _all(self._frames)
            won, won_ns = np.isfinite(frames.best[every]), frames.best_t_ns[every]
            stale = np.union1d(stale, every[(won & (won_ns > before_ns) & (won_ns < after_ns)).any((1, 2))])
        posed = frames.trajectory[stale] >= 0
        self._place(self._frames, stale)
        self._place(self._readings, moved)
        stale = stale[posed | (frames.trajectory[stale] >= 0)]
        changed = [self._resolve(row) for row in stale.tolist()]
        moved = moved[readings.trajectory[moved] >= 0]
        # A frame taken anew has seen all readings already.
        return any(changed + ([] if settled.rejoined else [self._offer(row) for row in moved.tolist()]))

    def collect(self, closing: int, *, only_closed: bool) -> Collected:
        """What is to be handed out."""
        ring, frames = self._frames, self._frames.columns
        rows = _all(ring)
        closed = rows < closing
        known = (frames.labels[rows] != UNKNOWN).any((1, 2))
        open_ = ~closed & frames.changed[rows] & (not only_closed)
        first = known & ~frames.told[rows]
        chosen = closed | (open_ & (known | frames.told[rows]))
        frames.changed[rows[open_]] = False
        rows, closed, first = rows[chosen], closed[chosen], first[chosen]
        frames.told[rows] |= first
        labels = frames.labels[rows]
        return Collected(
            frames.frame_id[rows],
            frames.t_ns[rows],
            labels,
            frames.weight[rows] if self._drift else (labels != UNKNOWN).astype(np.float32),
            closed,
            frames.trajectory[rows] >= 0,
            first,
        )

    # --- where the robot was

    def _place(self, ring: Ring[Readings] | Ring[Frames], rows: _Rows) -> None:
        """Set the pose at the rows' times: interpolated between the samples around each, exact on a sample."""
        samples, columns = self._track.live, ring.columns
        columns.trajectory[rows] = -1
        t_ns = columns.t_ns[rows]
        inside = np.zeros(len(rows), np.bool_)
        if len(samples.t_ns):
            inside = (t_ns >= samples.t_ns[0]) & (t_ns <= samples.t_ns[-1])
        rows, t_ns = rows[inside], t_ns[inside]
        after = np.searchsorted(samples.t_ns, t_ns, "left")
        before = np.where(samples.t_ns[after] == t_ns, after, after - 1)
        joined = samples.trajectory[before] == samples.trajectory[after]
        rows, t_ns, before, after = rows[joined], t_ns[joined], before[joined], after[joined]
        fraction = (t_ns - samples.t_ns[before]) / np.maximum(samples.t_ns[after] - samples.t_ns[before], 1)
        start, stop = (np.stack([samples.x_m[at], samples.y_m[at], samples.yaw_rad[at]], -1) for at in (before, after))
        pose = interpolate(start, stop, fraction)
        columns.x_m[rows], columns.y_m[rows], columns.yaw_rad[rows] = pose.T
        columns.trajectory[rows] = samples.trajectory[after]
        columns.sums[rows] = samples.sums[before] + fraction[:, None] * (samples.sums[after] - samples.sums[before])
        if isinstance(columns, Frames):  # numpy's own may differ from the compiler's in the last bit
            columns.cos[rows] = [math.cos(yaw_rad) for yaw_rad in pose[:, 2].tolist()]
            columns.sin[rows] = [math.sin(yaw_rad) for yaw_rad in pose[:, 2].tolist()]

    # --- which reading wins

    def _resolve(self, row: int) -> bool:
        """Take a frame's labels afresh from all readings kept."""
        frames = self._frames.columns
        frames.best[row], frames.labels[row], frames.weight[row] = np.inf, UNKNOWN, 0.0
        frames.changed[row] = True
        t_ns, window_ns = frames.t_ns.item(row), self._places.window_ns
        readings = _inside(self._readings, t_ns - window_ns - 1, t_ns + window_ns + 1)
        frame, reading, target, distance, weight = self._match(np.array([row]), readings)
        times = self._readings.columns.t_ns[reading]
        slot = self._readings.columns.stream[reading] * len(self._places.x_m) + target
        order = np.lexsort((times, np.abs(times - t_ns), distance, slot))
        won = order[np.flatnonzero(np.diff(slot[order], prepend=-1))]
        self._label(frame[won], reading[won], target[won], distance[won], weight[won])
        return True

    def _offer(self, row: int) -> bool:
        """Hold one reading against the frames waiting."""
        frames, readings = self._frames.columns, self._readings.columns
        t_ns, stream, window_ns = readings.t_ns.item(row), readings.stream.item(row), self._places.window_ns
        waiting = _inside(self._frames, t_ns - window_ns - 1, t_ns + window_ns + 1)
        frame, reading, target, distance, weight = self._match(waiting, np.array([row]))
        best, best_t_ns = frames.best[frame, stream, target], frames.best_t_ns[frame, stream, target]
        apart, best_apart = np.abs(t_ns - frames.t_ns[frame]), np.abs(best_t_ns - frames.t_ns[frame])
        sooner = (apart < best_apart) | ((apart == best_apart) & (t_ns < best_t_ns))
        won = (distance < best) | ((distance == best) & sooner)
        return self._label(frame[won], reading[won], target[won], distance[won], weight[won])

    def _label(
        self, frame: _Rows, reading: _Rows, target: _Rows, distance: Floats, weight: NDArray[np.float32]
    ) -> bool:
        """Let readings label targets of frames, each pair of these once; did a label change?"""
        frames, readings = self._frames.columns, self._readings.columns
        stream = readings.stream[reading]
        frames.best[frame, stream, target] = distance
        frames.best_t_ns[frame, stream, target] = readings.t_ns[reading]
        sensor = self._places.sensors[stream]
        pair, place = np.nonzero(sensor >= 0)
        at = (frame[pair], target[pair], sensor[pair, place])
        bits = readings.bits[reading[pair], place]
        changed = frames.labels[at] != bits
        frames.labels[at] = bits
        if self._drift:
            known = np.where(bits == UNKNOWN, np.float32(0), weight[pair])
            changed |= frames.weight[at] != known
            frames.weight[at] = known
        frames.changed[at[0][changed]] = True
        return bool(changed.any())

    def _match(self, frame: _Rows, reading: _Rows) -> tuple[_Rows, _Rows, _Rows, Floats, NDArray[np.float32]]:
        """The pairs of frame and reading, one row against many, and the targets that the reading lies within tolerance
        of: (M,) frame, reading, target, distance [m], and the probability that it truly did.
        """
        frames, readings, places = self._frames.columns, self._readings.columns, self._places
        frame, reading = np.broadcast_arrays(frame, reading)
        joined = (frames.trajectory[frame] == readings.trajectory[reading]) & (frames.trajectory[frame] >= 0)
        frame, reading = frame[joined], reading[joined]
        dx, dy = readings.x_m[reading] - frames.x_m[frame], readings.y_m[reading] - frames.y_m[frame]
        cos, sin = frames.cos[frame], frames.sin[frame]
        x, y = cos * dx + sin * dy, cos * dy - sin * dx
        pair, target = places.find(x, y)
        off_x, off_y = x[pair] - places.x_m[target], y[pair] - places.y_m[target]
        distance = np.sqrt(off_x * off_x + off_y * off_y)
        turned = readings.yaw_rad[reading] - frames.yaw_rad[frame]
        off_yaw = wrap(turned[pair] - places.yaw_rad[target])
        near = distance <= places.position_tolerance_m
        if math.isfinite(places.heading_tolerance_rad):
            near &= np.abs(off_yaw) <= places.heading_tolerance_rad
        weight = np.ones(len(pair), np.float32)
        if self._drift:
            known, weight = self._certainty(frame[pair], reading[pair], np.stack([off_x, off_y], -1), off_yaw)
            near &= known
        return frame[pair[near]], reading[pair[near]], target[near], distance[near], weight[near]

    def _certainty(
        self, frame: _Rows, reading: _Rows, offset: Floats, off_yaw: Floats
    ) -> tuple[NDArray[np.bool_], NDArray[np.float32]]:
        """Is each pair's relative pose known to the gate, and how probably was the reading within tolerance?"""
        frames, readings, places = self._frames.columns, self._readings.columns, self._places
        position = np.stack([readings.x_m[reading], readings.y_m[reading]], -1)
        covariance, heading_variance = relative_covariance(frames.sums[frame], readings.sums[reading], position)
        cos, sin = frames.cos[frame], frames.sin[frame]
        world = np.stack([cos * offset[:, 0] - sin * offset[:, 1], sin * offset[:, 0] + cos * offset[:, 1]], -1)
        weight = within_disc(world, covariance, places.position_tolerance_m)
        if math.isfinite(places.heading_tolerance_rad):
            # Heading and position errors of a pair are correlated; taking them as independent errs by little and low.
            weight = weight * within_angle(off_yaw, heading_variance, places.heading_tolerance_rad)
        return axes(covariance)[0] <= places.gate_m, weight.astype(np.float32)


def _all(ring: Ring[Readings] | Ring[Frames]) -> _Rows:
    return np.arange(ring.start, ring.stop)


def _inside(ring: Ring[Readings] | Ring[Frames], before_ns: int, after_ns: int) -> _Rows:
    """The rows strictly between two times."""
    return np.arange(ring.from_ns(before_ns + 1), ring.from_ns(after_ns))
