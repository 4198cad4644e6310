"""The trajectory store: frames wait in it until the robot has stood, later or earlier, at the places they could see.

Streaming and exact: after every call, the labels handed out equal the label rule applied to all that has been seen,
for any order of arrival within `max_delay_s`. Each reading is held against the frames still waiting, and each frame
against the readings still kept, both within the window: the work for one message grows with the window, never with
the run.
"""

import logging
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.clock import Clock, Clocks
from replay.labels import UNKNOWN, Matcher, nearest_first
from replay.poses import Floats
from replay.ring import Ring
from replay.rule import LabelRule, OdometryLimits
from replay.targets import Targets
from replay.track import Moments, Track
from replay.uncertainty import SUMS, StepNoise

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class LabelUpdate:
    """What has become known of one frame.

    Attributes:
        frame_id: as given to `add_frame`.
        t_ns: the frame's time.
        labels: (T, S) int8, all of the frame's labels so far: 1, 0, -1 unknown.
        weight: (T, S) float32 in [0, 1]; 0 where unknown.
        picture: the frame's picture, with the first update that has a known label; None in every other.
        closed: the window has passed; this is the frame's last update.
        posed: odometry told where the frame was taken.
    """

    frame_id: int
    t_ns: int
    labels: NDArray[np.int8]
    weight: NDArray[np.float32]
    picture: NDArray[np.uint8] | None
    closed: bool
    posed: bool


class TrajectoryStore:
    """Two rings, readings and frames, over an odometry track.

    Args:
        targets: T target poses.
        streams: for each stream of readings, the sensors it speaks for, out of S; a reading competes only with the
            readings of its own stream.
        rule: the label rule.
        limits: when odometry can be trusted.
        noise: of odometry steps, wanted for `rule.window == "drift"`.
        budget_bytes: frames waiting beyond this are closed early, oldest first, and counted.

    >>> store = TrajectoryStore(Targets.line(0.0, 0.2, 0.1), [[0]], LabelRule(0.02, window_s=5.0), OdometryLimits())
    >>> for i in range(4):
    ...     t_ns = i * 100_000_000
    ...     _ = store.add_odometry(t_ns, np.array([i * 0.1, 0.0, 0.0]))
    ...     _ = store.add_frame(i, t_ns, np.zeros((2, 2, 3), np.uint8)) if i == 0 else None
    ...     updates = store.add_reading(t_ns, 0, np.array([i == 2], np.int8))
    ...     print([u.labels[:, 0].tolist() for u in updates])
    [[0, -1, -1]]
    [[0, 0, -1]]
    [[0, 0, 1]]
    []
    """

    def __init__(
        self,
        targets: Targets,
        streams: Sequence[Sequence[int]],
        rule: LabelRule,
        limits: OdometryLimits,
        noise: StepNoise | None = None,
        budget_bytes: int = 256_000_000,
    ) -> None:
        if rule.window == "drift" and noise is None:
            raise ValueError('rule.window = "drift" needs the noise of odometry steps, got noise=None')
        self._streams = [np.array(stream, np.int64) for stream in streams]
        self._sensors = 1 + max(int(stream.max()) for stream in self._streams)
        self._targets = len(targets)
        self._rule, self._limits = rule, limits
        self._matcher = Matcher(targets, rule)
        self._track = Track(limits, noise if rule.window == "drift" else None)
        self._budget_bytes = budget_bytes
        moment: dict[str, tuple[type[np.generic], tuple[int, ...]]] = {
            "pose": (np.float64, (3,)),
            "trajectory": (np.int64, ()),
            "sums": (np.float64, (SUMS,)),
        }
        self._readings = [Ring({**moment, "bits": (np.int8, (len(stream),))}) for stream in self._streams]
        slots, labels = (len(self._streams), self._targets), (self._targets, self._sensors)
        self._frames = Ring(
            {
                **moment,
                "id": (np.int64, ()),
                "best": (np.float64, slots),  # distance of the reading that labels each target now
                "best_t_ns": (np.int64, slots),
                "labels": (np.int8, labels),
                "weight": (np.float32, labels),
            }
        )
        self._pictures: dict[int, NDArray[np.uint8]] = {}
        self._picture_bytes = 0
        self._clock = Clock(limits.max_delay_s)
        self.drops: Counter[str] = Counter()

    # --- what a roboticist asks of it

    @property
    def waiting(self) -> int:
        """Frames whose window is still open."""
        return len(self._frames)

    @property
    def sizes(self) -> dict[str, int]:
        """Rows of every ring, and the bytes that pictures hold."""
        readings = sum(len(ring) for ring in self._readings)
        return {
            "frames": len(self._frames),
            "readings": readings,
            "odometry": len(self._track),
            "picture_bytes": self._picture_bytes,
        }

    def add_odometry(self, t_ns: int, pose: Floats, covariance: NDArray[np.float64] | None = None) -> list[LabelUpdate]:
        """Take in where the robot believes it is.

        Args:
            t_ns: the sensor's time.
            pose: (3,) `[x_m, y_m, yaw_rad]`.
            covariance: (3, 3) of that pose, accumulated; None where the robot gives none.
        """
        if not (np.isfinite(pose).all() and (covariance is None or np.isfinite(covariance).all())):
            self.drops["odometry: not a number"] += 1
            return []
        restarted = self._mind_the_clocks(t_ns)
        if not self._in_time(t_ns, "odometry") or self._repeated(self._track, t_ns, "odometry"):
            return restarted
        self._clock.heard_odometry(t_ns)
        before, after, rejoined = self._track.add(t_ns, pose, covariance)
        return restarted + self._settle(before, after, rejoined)

    def add_reading(self, t_ns: int, stream: int, bits: NDArray[np.int8]) -> list[LabelUpdate]:
        """Take in what the sensors of a stream said: `bits` (sensors of the stream,) int8, 1, 0 or -1 unknown."""
        ring = self._readings[stream]
        if not self._in_time(t_ns, "reading") or self._repeated(ring, t_ns, "reading"):
            return []
        self._clock.heard_other(t_ns)
        row = ring.insert(t_ns, {"bits": bits, "trajectory": -1})
        self._pose(ring, slice(row, row + 1))
        return self._emit(self._offer(stream, row)) + self._close()

    def add_frame(self, frame_id: int, t_ns: int, picture: NDArray[np.uint8]) -> list[LabelUpdate]:
        """Take in a frame; `frame_id` must be new. One that comes too late is closed at once."""
        if not self._in_time(t_ns, "frame"):
            shape = (self._targets, self._sensors)
            unknown = np.full(shape, UNKNOWN, np.int8)
            return [LabelUpdate(frame_id, t_ns, unknown, np.zeros(shape, np.float32), None, closed=True, posed=False)]
        self._clock.heard_other(t_ns)
        self._pictures[frame_id] = picture
        self._picture_bytes += picture.nbytes
        row = self._frames.insert(t_ns, {"id": frame_id, "trajectory": -1, "labels": UNKNOWN, "best": np.inf})
        self._pose(self._frames, slice(row, row + 1))
        self._resolve(row)
        return self._emit(np.array([row])) + self._close()

    def end_trajectory(self) -> list[LabelUpdate]:
        """Close every frame and forget all readings: a new recording, or a robot that was carried off."""
        updates = self._closing(len(self._frames))
        for ring in self._readings:
            ring.clear()
        self._track.clear()
        self._clock.reset()
        return updates

    def state(self) -> dict[str, NDArray[Any]]:
        """All that waits, as arrays that `restore` takes back exactly."""
        ids = np.array(list(self._pictures), np.int64)
        arrays: dict[str, NDArray[Any]] = {
            "clock": self._clock.state(),
            "picture_ids": ids,
        }
        if len(ids):
            arrays["pictures"] = np.stack(list(self._pictures.values()))
        for prefix, part in self._parts().items():
            arrays |= {f"{prefix}.{name}": column for name, column in part.state().items()}
        return arrays

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Become what `state` was taken from."""
        for prefix, part in self._parts().items():
            head = f"{prefix}."
            part.restore({name.removeprefix(head): column for name, column in state.items() if name.startswith(head)})
        self._pictures = {
            int(i): picture for i, picture in zip(state["picture_ids"], state.get("pictures", ()), strict=True)
        }
        self._picture_bytes = sum(picture.nbytes for picture in self._pictures.values())
        self._clock.restore(state["clock"])

    def _parts(self) -> dict[str, Ring | Track]:
        readings = {f"readings{index}": ring for index, ring in enumerate(self._readings)}
        return {"frames": self._frames, "odometry": self._track, **readings}

    # --- time

    @property
    def _settled_ns(self) -> int:
        """Every pose before this is final: no sample that may still arrive can lie around it."""
        watermark = self._clock.watermark_ns
        without_odometry = watermark - round(self._limits.max_gap_s * 1e9)
        return max(self._track.newest_until(watermark) or without_odometry, without_odometry)

    def _in_time(self, t_ns: int, what: str) -> bool:
        if self._clock.is_late(t_ns):
            self.drops[f"{what}: later than max_delay_s = {self._limits.max_delay_s:g} s allows"] += 1
            return False
        return True

    def _repeated(self, ring: Ring | Track, t_ns: int, what: str) -> bool:
        if repeated := ring.has(t_ns):
            self.drops[f"{what}: its time was there already"] += 1
        return repeated

    def _mind_the_clocks(self, t_ns: int) -> list[LabelUpdate]:
        """A clock that was set would make every odometry message late for ever: begin a new trajectory instead."""
        clocks, off_s = self._clock.judge(t_ns)
        if clocks is Clocks.APART:
            self.drops["clock: camera or short range are ahead of the odometry by more than 10 s"] += 1
        if clocks is not Clocks.SET_BACK:
            return []
        _LOG.warning(
            "the odometry clock jumped back by %.3f s: the trajectory ends here and %d waiting frames are closed; "
            "if this repeats, look for two publishers on the odometry topic or a clock that is being set",
            off_s,
            len(self._frames),
        )
        return self.end_trajectory()

    # --- resolving

    def _settle(self, before_ns: int, after_ns: int, rejoined: bool) -> list[LabelUpdate]:
        """Odometry has settled or changed the poses strictly inside an interval, or how trajectories join."""
        if rejoined:
            return self._resolve_all()
        times = self._frames["t_ns"]
        inside = slice(int(np.searchsorted(times, before_ns, "right")), int(np.searchsorted(times, after_ns, "left")))
        self._pose(self._frames, inside)
        stale = np.zeros(len(self._frames), np.bool_)
        stale[inside] = True
        moved: list[tuple[int, slice]] = []
        late = after_ns < np.iinfo(np.int64).max
        for stream, ring in enumerate(self._readings):
            at = ring["t_ns"]
            rows = slice(int(np.searchsorted(at, before_ns, "right")), int(np.searchsorted(at, after_ns, "left")))
            if late:  # a frame that such a reading labels already must look for its nearest afresh
                best_t_ns = self._frames["best_t_ns"][:, stream]
                labelled = np.isfinite(self._frames["best"][:, stream])
                stale |= (labelled & (best_t_ns > before_ns) & (best_t_ns < after_ns)).any(1)
            self._pose(ring, rows)
            moved.append((stream, rows))
        for row in np.flatnonzero(stale):
            self._resolve(int(row))
        changed = [np.flatnonzero(stale)]
        changed += [self._offer(stream, row) for stream, rows in moved for row in range(rows.start, rows.stop)]
        return self._emit(np.unique(np.concatenate(changed))) + self._close()

    def _resolve_all(self) -> list[LabelUpdate]:
        """A late sample has changed which poses may be joined: take every waiting frame again."""
        for ring in (self._frames, *self._readings):
            self._pose(ring, slice(0, len(ring)))
        for row in range(len(self._frames)):
            self._resolve(row)
        return self._emit(np.arange(len(self._frames))) + self._close()

    def _pose(self, ring: Ring, rows: slice) -> None:
        """Set where the robot was at the rows' times."""
        moments = self._track.at(ring["t_ns"][rows])
        ring["pose"][rows], ring["trajectory"][rows], ring["sums"][rows] = (
            moments.pose,
            moments.trajectory,
            moments.sums,
        )

    def _resolve(self, row: int) -> None:
        """Take a frame's labels afresh from all readings kept."""
        frames, t_ns = self._frames, int(self._frames["t_ns"][row])
        frames["best"][row], frames["labels"][row], frames["weight"][row] = np.inf, UNKNOWN, 0.0
        frame = _moments(frames, slice(row, row + 1))
        for stream, (ring, sensors) in enumerate(zip(self._readings, self._streams, strict=True)):
            window = ring.between(t_ns - self._rule.window_ns, t_ns + self._rule.window_ns)
            found = self._matcher.match(frame, _moments(ring, window))
            times = ring["t_ns"][window][found.pair]
            won = nearest_first(found.target, found.distance, np.abs(times - t_ns), times)
            bits = ring["bits"][window][found.pair[won]]
            target = found.target[won]
            frames["best"][row, stream, target] = found.distance[won]
            frames["best_t_ns"][row, stream, target] = times[won]
            frames["labels"][row][target[:, None], sensors] = bits
            frames["weight"][row][target[:, None], sensors] = np.where(bits == UNKNOWN, 0, found.weight[won, None])

    def _offer(self, stream: int, row: int) -> NDArray[np.int64]:
        """Hold one reading against the frames waiting; the rows of those whose labels it changed."""
        ring, frames, sensors = self._readings[stream], self._frames, self._streams[stream]
        t_ns, bits = int(ring["t_ns"][row]), ring["bits"][row]
        window = frames.between(t_ns - self._rule.window_ns, t_ns + self._rule.window_ns)
        found = self._matcher.match(_moments(frames, window), _moments(ring, slice(row, row + 1)))
        frame, target = found.pair + window.start, found.target
        best, best_t_ns = frames["best"][frame, stream, target], frames["best_t_ns"][frame, stream, target]
        frame_t_ns = frames["t_ns"][frame]
        apart, best_apart = np.abs(t_ns - frame_t_ns), np.abs(best_t_ns - frame_t_ns)
        sooner = (apart < best_apart) | ((apart == best_apart) & (t_ns < best_t_ns))
        won = (found.distance < best) | ((found.distance == best) & sooner)
        frame, target = frame[won], target[won]
        frames["best"][frame, stream, target] = found.distance[won]
        frames["best_t_ns"][frame, stream, target] = t_ns
        weight = np.where(bits == UNKNOWN, np.float32(0), found.weight[won, None])
        at = (frame[:, None], target[:, None], sensors)
        changed = ((frames["labels"][at] != bits) | (frames["weight"][at] != weight)).any(1)
        frames["labels"][at] = bits
        frames["weight"][at] = weight
        return np.unique(frame[changed])

    # --- handing out, closing, forgetting

    def _emit(self, rows: NDArray[np.int64]) -> list[LabelUpdate]:
        """Updates of the rows that have, or had, a known label."""
        updates: list[LabelUpdate] = []
        for row in rows:
            frame_id = int(self._frames["id"][row])
            known = bool((self._frames["labels"][row] != UNKNOWN).any())
            if known or frame_id not in self._pictures:
                updates.append(self._update(int(row), self._take_picture(frame_id), closed=False))
        return updates

    def _update(self, row: int, picture: NDArray[np.uint8] | None, *, closed: bool) -> LabelUpdate:
        frames = self._frames
        return LabelUpdate(
            int(frames["id"][row]),
            int(frames["t_ns"][row]),
            frames["labels"][row].copy(),
            frames["weight"][row].copy(),
            picture,
            closed,
            bool(frames["trajectory"][row] >= 0),
        )

    def _take_picture(self, frame_id: int) -> NDArray[np.uint8] | None:
        picture = self._pictures.pop(frame_id, None)
        self._picture_bytes -= 0 if picture is None else picture.nbytes
        return picture

    def _close(self) -> list[LabelUpdate]:
        """Close the frames whose window has passed, or that the budget has no room for; forget what none needs."""
        settled = self._settled_ns
        passed = int(np.searchsorted(self._frames["t_ns"], settled - self._rule.window_ns, "left"))
        room = max(self._budget_bytes - self._picture_bytes, 0) // self._frames.row_bytes
        early = max(len(self._frames) - room - passed, 0)
        if early:
            self.drops["frame: closed before its window passed, for want of memory.store_mb"] += early
        updates = self._closing(passed + early)
        keep_from = settled - 2 * self._rule.window_ns
        for ring in self._readings:
            ring.drop(int(np.searchsorted(ring["t_ns"], keep_from, "left")))
        self._track.forget_before(keep_from)
        return updates

    def _closing(self, rows: int) -> list[LabelUpdate]:
        updates = [self._update(row, None, closed=True) for row in range(rows)]
        for update in updates:
            self._take_picture(update.frame_id)
        self._frames.drop(rows)
        return updates


def _moments(ring: Ring, rows: slice) -> Moments:
    return Moments(ring["pose"][rows], ring["trajectory"][rows], ring["sums"][rows])
