"""The label rule, compiled: what `replay.labels` does in numpy, pair by pair and in place.

The reading that has just come is carried into the axes of all frames of its window, a plain loop over columns that the
compiler makes vector code of, and from there into the hash of the targets; only where a target is near does anything
more happen. So what a message costs is a pass over its window plus what changes, whatever the number of targets.

Names, steps and the order of every sum are those of the reference: the same readings win, to the last bit.

The columns come as addresses, in one array: to hand over forty arrays one by one would take longer than the work. One
long file, because numba's cache looks at a kernel's own file only.
"""

import importlib
import math
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from replay.columns import Frames, Readings, Samples
from replay.compiling import jit
from replay.places import Places
from replay.solver import Store
from replay.uncertainty import LEAST, NODES, REACH, WEIGHTS

_numba: Any = importlib.import_module("numba")
_extending: Any = importlib.import_module("numba.extending")
_carray: Any = _numba.carray
# Cached as part of the kernels, and inlined: a call would count references to all columns, ten times the work.
_helper: Any = _numba.njit(nogil=True, error_model="numpy", forceinline=True)
_vector: Any = _numba.njit(nogil=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})

_UNKNOWN = -1
_ROOT = math.sqrt(2 * math.pi)


# --- the columns, and where they lie


class Rows(NamedTuple):
    """The rings' columns, as the kernels see them."""

    samples: Samples
    readings: Readings
    frames: Frames
    places: Places


def addresses(store: Store) -> NDArray[np.int64]:
    """Where everything lies: nine dimensions, then the address of each array; good until a ring makes room."""
    samples, readings, frames, places = store.track.columns, store.readings.columns, store.frames.columns, store.places
    arrays = [array for part in (samples, readings, frames, places[:9]) for array in part]
    if not all(array.flags.c_contiguous for array in arrays):
        raise ValueError("the label rule's kernels want columns in C order")
    dimensions = [
        len(samples.t_ns),
        len(readings.t_ns),
        len(frames.t_ns),
        frames.sums.shape[1],
        *frames.best.shape[1:],
        frames.labels.shape[2],
        places.sensors.shape[1],
        len(places.near),
    ]
    return np.array([*dimensions, *(array.ctypes.data for array in arrays)], np.int64)


@_extending.intrinsic
def _pointer(_context: Any, address: Any) -> Any:
    """A number as a pointer."""

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(_numba.types.voidptr))

    return _numba.types.voidptr(address), generate


@_helper
def _floats(at: Any, index: int, shape: Any) -> Any:
    return _carray(_pointer(at[index]), shape, np.float64)


@_helper
def _integers(at: Any, index: int, shape: Any) -> Any:
    return _carray(_pointer(at[index]), shape, np.int64)


@_helper
def _flags(at: Any, index: int, shape: Any) -> Any:
    return _carray(_pointer(at[index]), shape, np.bool_)


@_helper
def _samples(at: Any) -> Samples:
    n, sums = at[0], at[3]
    return Samples(
        _integers(at, 9, n),
        _floats(at, 10, n),
        _floats(at, 11, n),
        _floats(at, 12, n),
        _integers(at, 13, n),
        _floats(at, 14, (n, sums)),
        _floats(at, 15, (n, 3, 3)),
        _flags(at, 16, n),
    )


@_helper
def _readings(at: Any) -> Readings:
    n, sums, sensors = at[1], at[3], at[7]
    return Readings(
        _integers(at, 17, n),
        _floats(at, 18, n),
        _floats(at, 19, n),
        _floats(at, 20, n),
        _integers(at, 21, n),
        _floats(at, 22, (n, sums)),
        _integers(at, 23, n),
        _carray(_pointer(at[24]), (n, sensors), np.int8),
    )


@_helper
def _frames(at: Any) -> Frames:
    n, sums, streams, targets, sensors = at[2], at[3], at[4], at[5], at[6]
    weighed = targets if sums > 0 else 0
    return Frames(
        _integers(at, 25, n),
        _floats(at, 26, n),
        _floats(at, 27, n),
        _floats(at, 28, n),
        _integers(at, 29, n),
        _floats(at, 30, (n, sums)),
        _floats(at, 31, n),
        _floats(at, 32, n),
        _integers(at, 33, n),
        _floats(at, 34, (n, streams, targets)),
        _integers(at, 35, (n, streams, targets)),
        _carray(_pointer(at[36]), (n, targets, sensors), np.int8),
        _carray(_pointer(at[37]), (n, weighed, sensors), np.float32),
        _flags(at, 38, n),
        _flags(at, 39, n),
    )


@_helper
def _places(at: Any, tolerances: tuple[float, float, float], window_ns: int) -> Places:
    streams, targets, sensors = at[4], at[5], at[7]
    cells = _integers(at, 47, 2)
    position_m, heading_rad, gate_m = tolerances
    return Places(
        _floats(at, 40, targets),
        _floats(at, 41, targets),
        _floats(at, 42, targets),
        _carray(_pointer(at[43]), cells[0] * cells[1] + 1, np.int32),
        _carray(_pointer(at[44]), at[8], np.int32),
        _floats(at, 45, 2),
        _floats(at, 46, 2),
        cells,
        _integers(at, 48, (streams, sensors)),
        position_m,
        heading_rad,
        gate_m,
        window_ns,
    )


@_helper
def _rows(at: Any, tolerances: tuple[float, float, float], window_ns: int) -> Rows:
    return Rows(_samples(at), _readings(at), _frames(at), _places(at, tolerances, window_ns))


# --- where the robot was


@_helper
def _from(t_ns: NDArray[np.int64], start: int, stop: int, limit_ns: int) -> int:
    """The first row that is not older."""
    while start < stop:
        middle = (start + stop) // 2
        if t_ns[middle] < limit_ns:
            start = middle + 1
        else:
            stop = middle
    return start


@_helper
def _wrap(angle_rad: float) -> float:
    turned = angle_rad + math.pi
    if turned < 0 or turned >= 2 * math.pi:
        turned %= 2 * math.pi
    return turned - math.pi


@_helper
def _place(samples: Samples, start: int, stop: int, rows: Any, row: int) -> None:
    """Set the pose at the row's time: interpolated between the samples around it, exact on a sample."""
    t_ns = rows.t_ns[row]
    after = _from(samples.t_ns, start, stop, t_ns)
    rows.trajectory[row] = -1
    if after == stop:
        return
    before = after if samples.t_ns[after] == t_ns else after - 1
    if before < start or samples.trajectory[before] != samples.trajectory[after]:
        return
    fraction = (t_ns - samples.t_ns[before]) / max(samples.t_ns[after] - samples.t_ns[before], 1)
    turn = _wrap(samples.yaw_rad[after] - samples.yaw_rad[before])
    rows.x_m[row] = samples.x_m[before] + fraction * (samples.x_m[after] - samples.x_m[before])
    rows.y_m[row] = samples.y_m[before] + fraction * (samples.y_m[after] - samples.y_m[before])
    rows.yaw_rad[row] = _wrap(samples.yaw_rad[before] + fraction * turn)
    rows.trajectory[row] = samples.trajectory[after]
    for k in range(samples.sums.shape[1]):
        rows.sums[row, k] = samples.sums[before, k] + fraction * (samples.sums[after, k] - samples.sums[before, k])


@_helper
def _place_frame(samples: Samples, start: int, stop: int, frames: Frames, row: int) -> None:
    _place(samples, start, stop, frames, row)
    if frames.trajectory[row] >= 0:
        frames.cos[row], frames.sin[row] = math.cos(frames.yaw_rad[row]), math.sin(frames.yaw_rad[row])


# --- which targets are near


@_helper
def _cell(x_m: float, y_m: float, corner: tuple[float, float, float, float], most_x: float, most_y: float) -> Any:
    """Where a point lies in the hash; all that is outside is in the outermost cells, and so is what is no number."""
    corner_x, corner_y, per_x, per_y = corner
    cx, cy = (x_m - corner_x) * per_x, (y_m - corner_y) * per_y
    cx = cx if cx > 0.0 else 0.0
    cy = cy if cy > 0.0 else 0.0
    cx = cx if cx < most_x else most_x
    cy = cy if cy < most_y else most_y
    return np.int32(cx) * np.int32(most_y + 1.0) + np.int32(cy)


@_helper
def _keep_near(cell: Any, places: Places) -> Any:
    """Replace the cells by the indices of those that have targets near; how many."""
    count, first = 0, places.first
    for i in range(len(cell)):
        here = cell[i]
        cell[count] = i
        count += first[here + 1] > first[here]
    return count


@_helper
def _frames_near(readings: Readings, row: int, frames: Frames, start: int, stop: int, places: Places) -> Any:
    """Which frames from `start` on have a target near the reading."""
    x_m, y_m = readings.x_m[row], readings.y_m[row]
    corner = (places.corner_m[0], places.corner_m[1], places.per_m[0], places.per_m[1])
    most_x, most_y = places.cells[0] - 1.0, places.cells[1] - 1.0
    at_x, at_y = frames.x_m[start:stop], frames.y_m[start:stop]
    all_cos, all_sin = frames.cos[start:stop], frames.sin[start:stop]
    cell = np.empty(stop - start, np.int32)
    for i in range(stop - start):
        dx, dy, cos, sin = x_m - at_x[i], y_m - at_y[i], all_cos[i], all_sin[i]
        cell[i] = _cell(cos * dx + sin * dy, cos * dy - sin * dx, corner, most_x, most_y)
    return cell[: _keep_near(cell, places)]


@_helper
def _readings_near(frames: Frames, row: int, readings: Readings, start: int, stop: int, places: Places) -> Any:
    """Which readings from `start` on have a target of the frame near."""
    x_m, y_m, cos, sin = frames.x_m[row], frames.y_m[row], frames.cos[row], frames.sin[row]
    corner = (places.corner_m[0], places.corner_m[1], places.per_m[0], places.per_m[1])
    most_x, most_y = places.cells[0] - 1.0, places.cells[1] - 1.0
    at_x, at_y = readings.x_m[start:stop], readings.y_m[start:stop]
    cell = np.empty(stop - start, np.int32)
    for i in range(stop - start):
        dx, dy = at_x[i] - x_m, at_y[i] - y_m
        cell[i] = _cell(cos * dx + sin * dy, cos * dy - sin * dx, corner, most_x, most_y)
    return cell[: _keep_near(cell, places)]


@_helper
def _cell_of(at: tuple[float, float], places: Places) -> int:
    corner = (places.corner_m[0], places.corner_m[1], places.per_m[0], places.per_m[1])
    return _cell(at[0], at[1], corner, places.cells[0] - 1.0, places.cells[1] - 1.0)


# --- which reading wins


@_helper
def _is_sooner(frame_ns: int, t_ns: int, best_t_ns: int) -> bool:
    apart, best_apart = abs(t_ns - frame_ns), abs(best_t_ns - frame_ns)
    return apart < best_apart or (apart == best_apart and t_ns < best_t_ns)


@_helper
def _seen_from(frames: Frames, frame: int, readings: Readings, reading: int) -> tuple[float, float]:
    """Where the reading was, in the frame's axes."""
    dx, dy = readings.x_m[reading] - frames.x_m[frame], readings.y_m[reading] - frames.y_m[frame]
    cos, sin = frames.cos[frame], frames.sin[frame]
    return cos * dx + sin * dy, cos * dy - sin * dx


@_helper
def _wins(rows: Rows, frame: int, reading: int, target: int, at: tuple[float, float]) -> bool:
    """Is the reading, at this place in the frame's axes, a nearer one for the target? Then it is noted down."""
    _, readings, frames, places = rows
    stream, t_ns = readings.stream[reading], readings.t_ns[reading]
    off_x, off_y = at[0] - places.x_m[target], at[1] - places.y_m[target]
    distance = math.sqrt(off_x * off_x + off_y * off_y)
    best = frames.best[frame, stream, target]
    if distance > places.position_tolerance_m or distance > best:
        return False
    if distance == best and not _is_sooner(frames.t_ns[frame], t_ns, frames.best_t_ns[frame, stream, target]):
        return False
    if places.heading_tolerance_rad < math.inf:
        turned = readings.yaw_rad[reading] - frames.yaw_rad[frame]
        if abs(_wrap(turned - places.yaw_rad[target])) > places.heading_tolerance_rad:
            return False
    if frames.sums.shape[1] > 0 and _ellipse(rows, frame, reading)[0] > places.gate_m:
        return False
    frames.best[frame, stream, target] = distance
    frames.best_t_ns[frame, stream, target] = t_ns
    return True


@_helper
def _label(rows: Rows, frame: int, reading: int, target: int, at: tuple[float, float]) -> bool:
    """Set what the reading's sensors said; did anything change?"""
    _, readings, frames, places = rows
    stream, changed, drift = readings.stream[reading], False, frames.sums.shape[1] > 0
    weight = np.float32(_certainty(rows, frame, reading, target, at)) if drift else np.float32(1.0)
    for k in range(places.sensors.shape[1]):
        sensor = places.sensors[stream, k]
        if sensor < 0:
            break
        bit = readings.bits[reading, k]
        changed |= frames.labels[frame, target, sensor] != bit
        frames.labels[frame, target, sensor] = bit
        if drift:
            known = np.float32(0.0) if bit == _UNKNOWN else weight
            changed |= frames.weight[frame, target, sensor] != known
            frames.weight[frame, target, sensor] = known
    return changed


@_helper
def _offer(rows: Rows, row: int, start: int, stop: int) -> bool:
    """Hold one reading against the frames waiting; did a label change?"""
    _, readings, frames, places = rows
    any_changed, trajectory = False, readings.trajectory[row]
    if trajectory < 0:
        return False
    first = _from(frames.t_ns, start, stop, readings.t_ns[row] - places.window_ns)
    last = _from(frames.t_ns, start, stop, readings.t_ns[row] + places.window_ns + 1)
    near = _frames_near(readings, row, frames, first, last, places)
    for i in range(len(near)):
        frame, changed = first + near[i], False
        if frames.trajectory[frame] != trajectory:
            continue
        at = _seen_from(frames, frame, readings, row)
        cell = _cell_of(at, places)
        for k in range(places.first[cell], places.first[cell + 1]):
            if _wins(rows, frame, row, places.near[k], at):
                changed |= _label(rows, frame, row, places.near[k], at)
        if changed:
            frames.changed[frame] = any_changed = True
    return any_changed


@_helper
def _resolve(rows: Rows, row: int, start: int, stop: int) -> None:
    """Take a frame's labels afresh from all readings kept."""
    _, readings, frames, places = rows
    frames.best[row], frames.labels[row], frames.changed[row] = math.inf, _UNKNOWN, True
    if frames.sums.shape[1] > 0:
        frames.weight[row] = 0.0
    trajectory = frames.trajectory[row]
    if trajectory < 0:
        return
    first = _from(readings.t_ns, start, stop, frames.t_ns[row] - places.window_ns)
    last = _from(readings.t_ns, start, stop, frames.t_ns[row] + places.window_ns + 1)
    near = _readings_near(frames, row, readings, first, last, places)
    # Who wins is known only at the end, and to weigh all who ever led would take most of the time.
    winner: Any = np.full(frames.best.shape[1:], -1, np.int64)
    for i in range(len(near)):
        reading = first + near[i]
        if readings.trajectory[reading] != trajectory:
            continue
        at = _seen_from(frames, row, readings, reading)
        cell = _cell_of(at, places)
        for k in range(places.first[cell], places.first[cell + 1]):
            if _wins(rows, row, reading, places.near[k], at):
                winner[readings.stream[reading], places.near[k]] = reading
    for stream in range(winner.shape[0]):
        for target in range(winner.shape[1]):
            reading = winner[stream, target]
            if reading >= 0:
                _label(rows, row, reading, target, _seen_from(frames, row, readings, reading))


# --- how sure that is


@_helper
def _ellipse(rows: Rows, frame: int, reading: int) -> tuple[float, float, float, float]:
    """Of the reading's position relative to the frame, in the world's axes: longer and shorter deviation [m], angle of
    the longer axis; and the heading's variance.
    """
    _, readings, frames, _ = rows
    x, y = readings.x_m[reading], readings.y_m[reading]
    here, there = frames.sums[frame], readings.sums[reading]
    later = 1.0 if there[0] >= here[0] else -1.0
    q, qx, qy = (there[0] - here[0]) * later, (there[1] - here[1]) * later, (there[2] - here[2]) * later
    qxx, qxy, qyy = (there[3] - here[3]) * later, (there[4] - here[4]) * later, (there[5] - here[5]) * later
    n_xx, n_xy, n_yy = (there[6] - here[6]) * later, (there[7] - here[7]) * later, (there[8] - here[8]) * later
    xx = max(q * y * y - 2 * y * qy + qyy + n_xx, 0.0)
    yy = max(q * x * x - 2 * x * qx + qxx + n_yy, 0.0)
    xy = -(q * x * y - x * qy - y * qx + qxy) + n_xy
    mean, lean = (xx + yy) / 2, (xx - yy) / 2
    half = math.sqrt(lean * lean + xy * xy)
    long, short = math.sqrt(max(mean + half, 0.0)), math.sqrt(max(mean - half, 0.0))
    return long, short, 0.5 * math.atan2(2 * xy, xx - yy), max(q, 0.0)


@_helper
def _below(z: float) -> float:
    """The normal distribution's share below `z`."""
    return 0.5 * math.erfc(-z * math.sqrt(0.5))


@_vector
def _exp(minus_y: float) -> float:
    """Of a number not above zero, to 2e-9 where it matters: multiplications alone, so that nodes go side by side."""
    z = max(minus_y, -64.0) / 256
    power = 1 + z * (1 + z / 2 * (1 + z / 3 * (1 + z / 4 * (1 + z / 5))))
    for _ in range(8):
        power *= power
    return power


@_vector
def _erf(x: float) -> float:
    """To 1.5e-7 (Abramowitz and Stegun 1964, 7.1.26)."""
    t = 1 / (1 + 0.3275911 * abs(x))
    series = t * (0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * (-1.453152027 + t * 1.061405429))))
    return math.copysign(1 - series * _exp(-x * x), x)


@_vector
def _within_disc(off_x: float, off_y: float, ellipse: tuple[float, float, float, float], radius: float) -> float:
    """See `replay.uncertainty.within_disc`; equal to it to 1e-6."""
    long, short, angle, _ = ellipse
    long, short = max(long, LEAST), max(short, LEAST)
    cos, sin = math.cos(angle), math.sin(angle)
    u, v = cos * off_x + sin * off_y, cos * off_y - sin * off_x
    low = math.asin(min(max((v - REACH * short) / radius, -1.0), 1.0))
    high = math.asin(min(max((v + REACH * short) / radius, -1.0), 1.0))
    middle_sin, middle_cos, half = math.sin((low + high) / 2), math.cos((low + high) / 2), (high - low) / 2
    total, scale = 0.0, math.sqrt(0.5) / long
    for k in range(len(NODES)):
        # Sine and cosine of an angle up to a right one, as the sums of their series.
        edge = half * NODES[k]
        e = edge * edge
        sine = edge * (1 - e / 6 * (1 - e / 20 * (1 - e / 42 * (1 - e / 72 * (1 - e / 110 * (1 - e / 156))))))
        cosine = 1 - e / 2 * (1 - e / 12 * (1 - e / 30 * (1 - e / 56 * (1 - e / 90 * (1 - e / 132 * (1 - e / 182))))))
        across = middle_sin * cosine + middle_cos * sine
        chord = radius * (middle_cos * cosine - middle_sin * sine)
        off = (radius * across - v) / short
        total += WEIGHTS[k] * _exp(-0.5 * off * off) * chord * (_erf((chord - u) * scale) + _erf((chord + u) * scale))
    return min(max(half * total / (2 * short * _ROOT), 0.0), 1.0)


@_helper
def _certainty(rows: Rows, frame: int, reading: int, target: int, at: tuple[float, float]) -> float:
    """How probably the reading was within the tolerances of the target."""
    _, readings, frames, places = rows
    ellipse = _ellipse(rows, frame, reading)
    off_x, off_y = at[0] - places.x_m[target], at[1] - places.y_m[target]
    cos, sin = frames.cos[frame], frames.sin[frame]
    world_x, world_y = cos * off_x - sin * off_y, sin * off_x + cos * off_y
    weight = _within_disc(world_x, world_y, ellipse, places.position_tolerance_m)
    if places.heading_tolerance_rad < math.inf:
        turned = readings.yaw_rad[reading] - frames.yaw_rad[frame]
        off, tolerance = _wrap(turned - places.yaw_rad[target]), places.heading_tolerance_rad
        deviation = max(math.sqrt(ellipse[3]), LEAST)
        weight *= _below((tolerance - off) / deviation) - _below((-tolerance - off) / deviation)
    return weight


# --- what is called


def build() -> SimpleNamespace:
    """`addresses`, and the kernels `take_reading`, `take_frames`, `take_odometry`, `count` and `collect`.

    Each takes what `addresses` gives and the live rows of the three rings, as (start, stop) pairs; those that come with
    a message the position tolerance, the heading tolerance and the gate, and the window; then its own.
    """
    rows_at = "int64[::1], UniTuple(int64, 6)"
    common = f"{rows_at}, UniTuple(float64, 3), int64"

    @jit(f"boolean({common}, int64)", error_model="numpy")
    def take_reading(at: Any, live: Any, tolerances: Any, window_ns: int, row: int) -> bool:
        rows = _rows(at, tolerances, window_ns)
        _place(rows.samples, live[0], live[1], rows.readings, row)
        return _offer(rows, row, live[4], live[5])

    @jit(f"boolean({common}, int64, int64)", error_model="numpy")
    def take_frames(at: Any, live: Any, tolerances: Any, window_ns: int, first: int, last: int) -> bool:
        rows, posed = _rows(at, tolerances, window_ns), False
        for row in range(first, last):
            _place_frame(rows.samples, live[0], live[1], rows.frames, row)
            _resolve(rows, row, live[2], live[3])
            rows.frames.told[row] = False
            rows.frames.changed[row] = rows.frames.trajectory[row] >= 0
            posed |= rows.frames.changed[row]
        return posed

    @jit(f"boolean({common}, int64, int64, boolean, boolean)", error_model="numpy")
    def take_odometry(
        at: Any, live: Any, tolerances: Any, window_ns: int, before_ns: int, after_ns: int, late: bool, rejoined: bool
    ) -> bool:
        rows, changed = _rows(at, tolerances, window_ns), False
        samples, readings, frames, _ = rows
        first, last = live[2], live[3]
        if not rejoined:
            first = _from(readings.t_ns, live[2], live[3], before_ns + 1)
            last = _from(readings.t_ns, live[2], live[3], after_ns)
        stale = np.zeros(live[5] - live[4], np.bool_)
        for row in range(live[4], live[5]):
            t_ns = frames.t_ns[row]
            inside = rejoined or before_ns < t_ns < after_ns
            # What a reading labels whose pose is now another must look for its nearest afresh.
            if inside or (late and _won_within(frames, row, before_ns, after_ns)):
                posed = frames.trajectory[row] >= 0
                _place_frame(samples, live[0], live[1], frames, row)
                stale[row - live[4]] = posed or frames.trajectory[row] >= 0
        for row in range(first, last):
            _place(samples, live[0], live[1], readings, row)
        for i in range(len(stale)):
            if stale[i]:
                _resolve(rows, live[4] + i, live[2], live[3])
                changed = True
        if not rejoined:  # else every frame has seen all readings already
            for row in range(first, last):
                changed |= _offer(rows, row, live[4], live[5])
        return changed

    @jit(f"int64({rows_at}, int64, boolean)", error_model="numpy")
    def count(at: Any, live: Any, closing: int, only_closed: bool) -> int:
        """How many rows `collect` will hand out; 0 costs next to nothing."""
        frames, found = _frames(at), closing - live[4]
        for row in range(closing, live[5] if not only_closed else closing):
            found += frames.changed[row]
        return found

    @jit(
        f"int64({rows_at}, int64, boolean, int64[::1], int64[::1], int8[:, :, ::1], float32[:, :, ::1],"
        " boolean[::1], boolean[::1], boolean[::1])",
        error_model="numpy",
    )
    def collect(
        at: Any,
        live: Any,
        closing: int,
        only_closed: bool,
        frame_ids: Any,
        t_ns: Any,
        labels: Any,
        weight: Any,
        closed: Any,
        posed: Any,
        first: Any,
    ) -> int:
        """Fills the last seven, which have room for `count` rows; how many it filled."""
        frames, found = _frames(at), 0
        for row in range(live[4], closing if only_closed else live[5]):
            if row >= closing and not frames.changed[row]:
                continue
            if row >= closing:
                frames.changed[row] = False
            known = _any_known(frames, row)
            if row >= closing and not known and not frames.told[row]:
                continue
            frame_ids[found], t_ns[found] = frames.frame_id[row], frames.t_ns[row]
            labels[found] = frames.labels[row]
            if frames.sums.shape[1] > 0:
                weight[found] = frames.weight[row]
            else:
                _weigh_known(labels[found], weight[found])
            closed[found], posed[found] = row < closing, frames.trajectory[row] >= 0
            first[found] = known and not frames.told[row]
            frames.told[row] |= first[found]
            found += 1
        return found

    return SimpleNamespace(
        addresses=addresses,
        take_reading=take_reading,
        take_frames=take_frames,
        take_odometry=take_odometry,
        count=count,
        collect=collect,
    )


@_helper
def _won_within(frames: Frames, row: int, before_ns: int, after_ns: int) -> bool:
    """Does a reading from between these times label a target of the frame?"""
    for stream in range(frames.best.shape[1]):
        for target in range(frames.best.shape[2]):
            if frames.best[row, stream, target] < math.inf:
                t_ns = frames.best_t_ns[row, stream, target]
                if before_ns < t_ns < after_ns:
                    return True
    return False


@_helper
def _any_known(frames: Frames, row: int) -> bool:
    for target in range(frames.labels.shape[1]):
        for sensor in range(frames.labels.shape[2]):
            if frames.labels[row, target, sensor] != _UNKNOWN:
                return True
    return False


@_helper
def _weigh_known(labels: Any, weight: Any) -> None:
    """One where a label is known."""
    for target in range(labels.shape[0]):
        for sensor in range(labels.shape[1]):
            weight[target, sensor] = np.float32(labels[target, sensor] != _UNKNOWN)
