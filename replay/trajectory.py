"""The trajectory store: frames wait in it until the robot has stood, later or earlier, at the places they could see.

Streaming and exact: after every call, the labels handed out equal the label rule applied to all that has been seen,
for any order of arrival within `max_delay_s`. Each reading is held against the frames still waiting, and each frame
against the readings still kept, both within the window: the work for one message grows with the window, never with
the run.
"""

import logging
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.clock import Clock, Clocks
from replay.compiled_labels import Solvers
from replay.explanation import Explanation, explain, labels_at
from replay.poses import Floats
from replay.ring import Ring
from replay.rule import LabelRule, OdometryLimits
from replay.solver import Store
from replay.targets import Targets
from replay.uncertainty import StepNoise
from replay.updates import Updates

_LOG = logging.getLogger(__name__)
#: Who asks for closed frames alone is given those of so long at once.
_CLOSED_EVERY_NS = 1_000_000_000


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
        only_closed: hand out a frame once, when it closes: for those who read a whole recording anyway.
        explain_ns: time of a frame to explain when it closes.

    Attributes:
        explained: the frame to explain, once it has closed.

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
        *,
        only_closed: bool = False,
        explain_ns: int | None = None,
    ) -> None:
        self._store = store = Store.empty(targets, streams, rule, limits, noise)
        self._track, self._readings, self._frames, _ = store
        self._noise, self._explain_ns = noise, explain_ns
        self.explained: Explanation | None = None
        self._rule, self._limits, self._solvers = rule, limits, Solvers(store)
        self._shape = (len(targets), store.frames.columns.labels.shape[2])
        self.nothing = Updates.none(self._shape)
        self._budget_bytes, self._only_closed = budget_bytes, only_closed
        self._pictures: dict[int, NDArray[np.uint8]] = {}
        self._picture_bytes = 0
        self._frame_bytes = self._frames.row_bytes
        self._clock = Clock(limits.max_delay_s)
        self._watermark_ns = self._clock.watermark_ns
        self._settled_ns = self._final_ns()
        self.drops: Counter[str] = Counter()

    # --- what a roboticist asks of it

    @property
    def waiting(self) -> int:
        """Frames whose window is still open."""
        return len(self._frames)

    @property
    def sizes(self) -> dict[str, int]:
        """Rows of every ring, and the bytes that pictures hold."""
        return {
            "frames": len(self._frames),
            "readings": len(self._readings),
            "odometry": len(self._track),
            "picture_bytes": self._picture_bytes,
        }

    def add_odometry(self, t_ns: int, pose: Floats, covariance: NDArray[np.float64] | None = None) -> Updates:
        """Take in where the robot believes it is.

        Args:
            t_ns: the sensor's time.
            pose: (3,) `[x_m, y_m, yaw_rad]`.
            covariance: (3, 3) of that pose, accumulated; None where the robot gives none.
        """
        numbers = pose.tolist()
        if not (math.isfinite(sum(numbers)) and (covariance is None or math.isfinite(covariance.sum()))):
            self.drops["odometry: not a number"] += 1
            return self.nothing
        restarted = self._mind_the_clocks(t_ns)
        if not self._in_time(t_ns, "odometry") or self._repeated(self._track.has(t_ns), "odometry"):
            return restarted
        self._clock.heard_odometry(t_ns)
        settled = self._track.add(t_ns, numbers, covariance)
        updates = self._hand_out(self._solvers.now.take_odometry(settled), posed=True)
        return Updates.joined([restarted, updates]) if restarted else updates

    def add_reading(self, t_ns: int, stream: int, bits: NDArray[np.int8]) -> Updates:
        """Take in what the sensors of a stream said: `bits` (sensors of the stream,) int8, 1, 0 or -1 unknown."""
        same = self._readings.has(t_ns) and stream in self._readings.columns.stream[self._readings.at(t_ns)]
        if not self._in_time(t_ns, "reading") or self._repeated(same, "reading"):
            return self.nothing
        self._clock.heard_other(t_ns)
        row = self._readings.insert(t_ns)
        readings = self._readings.columns
        readings.stream[row], readings.bits[row, : len(bits)] = stream, bits
        return self._hand_out(self._solvers.now.take_reading(row))

    def add_frame(self, frame_id: int, t_ns: int, picture: NDArray[np.uint8]) -> Updates:
        """Take in a frame; `frame_id` must be new. One that comes too late is closed at once."""
        if not self._in_time(t_ns, "frame"):
            return Updates.lost(frame_id, t_ns, self._shape)
        self._clock.heard_other(t_ns)
        self._pictures[frame_id] = picture
        self._picture_bytes += picture.nbytes
        row = self._frames.insert(t_ns)
        self._frames.columns.frame_id[row] = frame_id
        return self._hand_out(self._solvers.now.take_frames(row, row + 1))

    def end_trajectory(self) -> Updates:
        """Close every frame and forget all readings: a new recording, or a robot that was carried off."""
        updates = self._collect(self._frames.stop)
        self._readings.clear()
        self._track.clear()
        self._clock.reset()
        self._watermark_ns, self._settled_ns = self._clock.watermark_ns, self._final_ns()
        return updates

    def labels_at(self, t_ns: int) -> tuple[int, NDArray[np.int8], NDArray[np.float32]] | None:
        """Id, labels (T, S) and weights (T, S), so far, of the frame taken at this time; None if none waits."""
        if not self._frames.has(t_ns):
            return None
        return labels_at(self._store, self._frames.from_ns(t_ns))

    def explain(self, t_ns: int) -> Explanation | None:
        """Why the labels so far of the frame taken at this time are what they are; None if no such frame waits."""
        if not self._frames.has(t_ns):
            return None
        return explain(self._store, self._frames.from_ns(t_ns), self._noise)

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
        self._watermark_ns, self._settled_ns = self._clock.watermark_ns, self._final_ns()

    def _parts(self) -> dict[str, Ring[Any]]:
        return {"frames": self._frames, "odometry": self._track, "readings": self._readings}

    # --- time

    def _final_ns(self) -> int:
        """Every pose before this is final: no sample that may still arrive can lie around it."""
        watermark = self._clock.watermark_ns
        without_odometry = watermark - round(self._limits.max_gap_s * 1e9)
        return max(self._track.newest_until(watermark) or without_odometry, without_odometry)

    def _in_time(self, t_ns: int, what: str) -> bool:
        if self._clock.is_late(t_ns):
            self.drops[f"{what}: later than max_delay_s = {self._limits.max_delay_s:g} s allows"] += 1
            return False
        return True

    def _repeated(self, repeated: bool, what: str) -> bool:
        if repeated:
            self.drops[f"{what}: its time was there already"] += 1
        return repeated

    def _mind_the_clocks(self, t_ns: int) -> Updates:
        """A clock that was set would make every odometry message late for ever: begin a new trajectory instead."""
        clocks, off_s = self._clock.judge(t_ns)
        if clocks is Clocks.APART:
            self.drops["clock: camera or short range are ahead of the odometry by more than 10 s"] += 1
        if clocks is not Clocks.SET_BACK:
            return self.nothing
        _LOG.warning(
            "the odometry clock jumped back by %.3f s: the trajectory ends here and %d waiting frames are closed; "
            "if this repeats, look for two publishers on the odometry topic or a clock that is being set",
            off_s,
            len(self._frames),
        )
        return self.end_trajectory()

    # --- handing out, closing, forgetting

    def _hand_out(self, changed: bool, *, posed: bool = False) -> Updates:
        """What became known, and the frames whose window has passed or that the budget has no room for.

        `posed`: there is new odometry.
        """
        watermark_ns = self._clock.watermark_ns
        if self._only_closed and 0 <= watermark_ns - self._watermark_ns < _CLOSED_EVERY_NS:
            return self.nothing
        if posed or watermark_ns != self._watermark_ns:
            self._watermark_ns = watermark_ns
            self._settle()
        closing = self._frames.passed(self._settled_ns - self._rule.window_ns)
        early = self._frames.stop - closing - (self._budget_bytes - self._picture_bytes) // self._frame_bytes
        early = min(max(early, 0), self._frames.stop - closing)
        if early:
            self.drops["frame: closed before its window passed, for want of memory.store_mb"] += early
        closing += early
        updates = self.nothing
        if closing > self._frames.start or (changed and not self._only_closed):
            updates = self._collect(closing)
        return updates

    def _settle(self) -> None:
        """Note how far poses are final, and forget the readings and samples that no frame can ask for any more."""
        self._settled_ns = self._final_ns()
        window_ns, frames = self._rule.window_ns, self._frames
        oldest_ns = frames.columns.t_ns.item(frames.start) if len(frames) else self._settled_ns
        keep_from = min(self._settled_ns - window_ns, oldest_ns) - window_ns
        self._readings.drop_before(self._readings.passed(keep_from))
        self._track.forget_before(keep_from)

    def _collect(self, closing: int) -> Updates:
        """Updates of what changed, and of the rows before `closing`, which leave."""
        if self._explain_ns is not None and self.explained is None and closing > self._frames.from_ns(self._explain_ns):
            self.explained = self.explain(self._explain_ns)
        found = self._solvers.now.collect(closing, only_closed=self._only_closed)
        pictures = {frame_id: self._take_picture(frame_id) for frame_id in found.frame_ids[found.first].tolist()}
        for frame_id in found.frame_ids[found.closed & ~found.first].tolist():
            if frame_id in self._pictures:
                self._take_picture(frame_id)
        self._frames.drop_before(closing)
        return Updates(found.frame_ids, found.t_ns, found.labels, found.weight, found.closed, found.posed, pictures)

    def _take_picture(self, frame_id: int) -> NDArray[np.uint8]:
        picture = self._pictures.pop(frame_id)
        self._picture_bytes -= picture.nbytes
        return picture
