"""Label resolution: a whole drive at once and message by message, beside a kd-tree a frame and brute numpy."""

import time
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from bench.drives import FINE, GRID, LIMITS, NOISE, RATE_HZ, RULE, STREAMS, listed, pioneer
from bench.rows import Figure, Growth, Row
from replay.resolution import Drive, resolve
from replay.targets import Targets
from replay.trajectory import TrajectoryStore

PICTURE = np.zeros((1, 1, 3), np.uint8)
CASES = {
    "289 grid targets": (GRID, None),
    "289 targets on no grid": (listed(289, heading=False), None),
    "289 targets on no grid, heading within 0.3 rad": (listed(289, heading=True), 0.3),
}


def window(drive: Drive, frame: int) -> slice:
    """The readings within the rule's time of a frame."""
    t_ns = drive.frames_ns[frame]
    return slice(*np.searchsorted(drive.readings_ns, [t_ns - RULE.window_ns, t_ns + RULE.window_ns + 1]))


def seen(drive: Drive, frame: int, within: slice) -> np.ndarray:
    """(N, 3): the poses of readings, as seen from a frame."""
    x, y, yaw = drive.poses[frame]
    dx, dy = drive.poses[within, 0] - x, drive.poses[within, 1] - y
    turn = (drive.poses[within, 2] - yaw + np.pi) % (2 * np.pi) - np.pi
    return np.stack([np.cos(yaw) * dx + np.sin(yaw) * dy, np.cos(yaw) * dy - np.sin(yaw) * dx, turn], -1)


def by_kd_tree(drive: Drive, frame: int, targets: Targets, heading: float | None) -> np.ndarray:
    """(T,) labels. With a heading tolerance, the nearest of the readings turned as wanted."""
    within = window(drive, frame)
    poses, bits, labels = seen(drive, frame, within), drive.bits[within, 0], np.full(len(targets), -1, np.int8)
    tree = cKDTree(poses[:, :2])
    if heading is None:
        distance, nearest = tree.query(targets.poses[:, :2], distance_upper_bound=RULE.position_tolerance_m)
        known = np.isfinite(distance)
        labels[known] = bits[nearest[known]]
        return labels
    for target, near in enumerate(tree.query_ball_point(targets.poses[:, :2], RULE.position_tolerance_m)):
        if near:
            off = poses[near] - targets.poses[target]
            turned = np.abs((off[:, 2] + np.pi) % (2 * np.pi) - np.pi) <= heading
            if turned.any():
                labels[target] = bits[near][turned][np.hypot(*off[turned, :2].T).argmin()]
    return labels


def by_brute_force(drive: Drive, frame: int, targets: Targets, heading: float | None) -> np.ndarray:
    """(T,) labels."""
    within = window(drive, frame)
    poses, bits = seen(drive, frame, within), drive.bits[within, 0]
    distance = np.hypot(*(poses[:, None, :2] - targets.poses[None, :, :2]).transpose(2, 0, 1))
    if heading is not None:
        turned = poses[:, None, 2] - targets.poses[None, :, 2]
        distance[np.abs((turned + np.pi) % (2 * np.pi) - np.pi) > heading] = np.inf
    nearest = distance.argmin(0)
    known = distance[nearest, np.arange(len(targets))] <= RULE.position_tolerance_m
    return np.where(known, bits[nearest], -1).astype(np.int8)


def touched(x_m: np.ndarray) -> None:
    """No program can do with less: read one coordinate of each reading of the window."""
    x_m.sum()


@pytest.mark.parametrize("name", CASES)
def test_a_whole_drive(record, short, name):
    targets, heading = CASES[name]
    rule, poses = replace(RULE, heading_tolerance_rad=heading), 6_000 if short else 84_000
    drive = pioneer(poses)
    frames = np.linspace(0, poses - 1, 60 if short else 200).astype(int)
    resolve(pioneer(100), targets, STREAMS, rule, LIMITS)
    times = {"ours": [], "kd-tree a frame (scipy)": [], "brute force (numpy)": [], "touch": []}
    for _ in range(3):
        start = time.perf_counter()
        ours = resolve(drive, targets, STREAMS, rule, LIMITS).labels[:, :, 0]
        times["ours"].append((time.perf_counter() - start) / poses)
        for frame in frames:
            start = time.perf_counter()
            theirs = by_kd_tree(drive, frame, targets, heading)
            times["kd-tree a frame (scipy)"].append(time.perf_counter() - start)
            assert (theirs == ours[frame]).mean() > 0.999  # equal distances, to rounding, may choose another reading
        for frame in frames[::10]:
            start = time.perf_counter()
            by_brute_force(drive, frame, targets, heading)
            times["brute force (numpy)"].append(time.perf_counter() - start)
        x_m = drive.poses[window(drive, poses // 2), 0].copy()
        start = time.perf_counter()
        for _ in range(1_000):
            touched(x_m)
        times["touch"].append((time.perf_counter() - start) / 1_000)
    figures = {peer: Figure(found) for peer, found in times.items()}
    limit = ("each reading of the window read once (numpy)", figures.pop("touch"))
    note = f"{poses:,} poses at {RATE_HZ} Hz, +-{RULE.window_s:g} s; one frame of a whole drive"
    bars = {"kd-tree a frame (scipy)": 25.0}
    record(Row(f"label resolution, {name}", figures.pop("ours"), figures, bars, limit, note=note))


class Streamed:
    """A drive fed to a store message by message; seconds of each call."""

    def __init__(self, drive: Drive, targets: Targets, rule, *, only_closed: bool = False):
        self.store = TrajectoryStore(targets, STREAMS, rule, LIMITS, only_closed=only_closed)
        self.odometry, self.reading, self.frame = [], [], []
        for row, (t_ns, pose) in enumerate(zip(drive.odometry_ns.tolist(), drive.poses, strict=True)):
            start = time.perf_counter()
            self.store.add_odometry(t_ns, pose)
            self.odometry.append(time.perf_counter() - start)
            start = time.perf_counter()
            self.store.add_reading(t_ns, 0, drive.bits[row])
            self.reading.append(time.perf_counter() - start)
            start = time.perf_counter()
            self.store.add_frame(row, t_ns, PICTURE)
            self.frame.append(time.perf_counter() - start)

    def last(self, what: str, share: float = 0.5) -> Figure:
        """Once the window is full."""
        times = getattr(self, what)
        return Figure(times[int(len(times) * share) :])


def test_a_reading_that_streams(record, short):
    drive = pioneer(3_000 if short else 6_000)
    Streamed(pioneer(100), GRID, RULE)
    few = Streamed(drive, GRID, RULE)
    record(
        Row(
            "label resolution, one reading as it comes, held against every waiting frame",
            few.last("reading"),
            most=50e-6,
            note=f"{few.store.waiting} frames waiting; odometry {1e6 * few.last('odometry').median:.0f} us, "
            f"a frame {1e6 * few.last('frame').median:.0f} us",
        )
    )
    figures = [Streamed(drive, targets, RULE, only_closed=True).last("reading") for targets in (GRID, FINE)]
    sizes = [len(GRID), len(FINE)]
    record(Growth("label resolution, one reading, not handing out", "targets", sizes, figures, 0.6))


def test_drift_window(record, short):
    drive, drift = pioneer(3_000 if short else 20_000), replace(RULE, window="drift", gate_m=1.0)
    fixed_s, drift_s = [], []
    for _ in range(3):
        for rule, found in ((RULE, fixed_s), (drift, drift_s)):
            start = time.perf_counter()
            resolve(drive, GRID, STREAMS, rule, LIMITS, NOISE)
            found.append((time.perf_counter() - start) / len(drive.poses))
    record(
        Row(
            "label resolution, drift window",
            Figure(drift_s),
            {"fixed window": Figure(fixed_s)},
            {"fixed window": 0.5},
            note=f"gate {drift.gate_m:g} m: no reading of the window is left out, so each label is weighed",
        )
    )


def test_growth(record, short):
    poses = 3_000 if short else 12_000

    def each(drive: Drive, targets: Targets, rule, streams=STREAMS) -> Figure:
        found = []
        for _ in range(3):
            start = time.perf_counter()
            resolve(drive, targets, streams, rule, LIMITS)
            found.append((time.perf_counter() - start) / len(drive.frames_ns))
        return Figure(found)

    base, path = pioneer(poses), "label resolution, a frame"
    spans = (6.0, 60.0) if short else (60.0, 600.0)
    long, windows = pioneer(poses * (1 if short else 3)), [replace(RULE, window_s=span) for span in spans]
    record(Growth(path, "window [s]", spans, [each(long, GRID, rule) for rule in windows], 1.05))
    record(Growth(path, "targets", [len(GRID), len(FINE)], [each(base, t, RULE) for t in (GRID, FINE)], 0.8))
    rates = [pioneer(poses * times, RATE_HZ * times) for times in (1, 5)]
    record(Growth(path, "sensor rate [Hz]", [20, 100], [each(drive, GRID, RULE) for drive in rates], 1.05))
    many = [(pioneer(poses // 8, streams=count), [[s] for s in range(count)]) for count in (1, 8)]
    record(Growth(path, "streams", [1, 8], [each(drive, GRID, RULE, streams) for drive, streams in many], 1.05))
    runs = [pioneer(poses // 2), pioneer(poses * 5)]
    record(Growth(path, "length of the run", [poses // 2, poses * 5], [each(d, GRID, RULE) for d in runs], 0.1))
