"""Frames of a while ago: what was seen and predicted then, and the labels that have become known of it since."""

from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.dashboard.sights import Shot

#: A frame each so many seconds of the robot's time: neighbours show much the same.
EVERY_S = 2.0
_MOST = 150
_MOST_BYTES = 32_000_000


@dataclass(eq=False)
class Past:
    """One of them.

    Attributes:
        key: counts up from 1.
        t_ns: the frame's time, by which the learner knows it.
        robot_s: the same, since the dashboard's first odometry.
        shots: what each camera saw.
        prediction: (T, S) uint8, 255 for certainty.
        labels: (T, S) int8: 1, 0, -1 unknown; None before the learner told.
        frame_id: the learner's; -1 before it told.
        closed: its window has passed, and the labels are final.
        explanation: of its labels, once asked for; see `llrp explain`.
        revision: of all this; higher than that of any frame changed before it.
    """

    key: int
    t_ns: int
    robot_s: float
    shots: tuple[Shot, ...]
    prediction: NDArray[np.uint8]
    labels: NDArray[np.int8] | None = None
    frame_id: int = -1
    closed: bool = False
    explanation: dict[str, Any] | None = None
    revision: int = 0


class Pasts:
    """The newest of them, within a budget of bytes.

    >>> pasts = Pasts()
    >>> for t_ns in (0, 1_000_000_000, 2_000_000_000):
    ...     pasts.offer(t_ns, t_ns * 1e-9, (), np.zeros((1, 1), np.uint8))
    >>> [past.robot_s for past in pasts]
    [0.0, 2.0]
    """

    def __init__(self) -> None:
        self._kept: OrderedDict[int, Past] = OrderedDict()
        self._last_ns: int | None = None
        self._bytes = 0
        self._count = 0
        self._revision = 0

    def __iter__(self) -> Iterator[Past]:
        """Oldest first."""
        return iter(list(self._kept.values()))

    def get(self, key: int) -> Past | None:
        """By its key; None if it is not kept any more."""
        return self._kept.get(key)

    def offer(self, t_ns: int, robot_s: float, shots: tuple[Shot, ...], prediction: NDArray[np.uint8]) -> None:
        """Keep a frame, if it is time for one."""
        if self._last_ns is not None and 0 <= t_ns - self._last_ns < EVERY_S * 1e9:
            return
        self._last_ns = t_ns
        self._count += 1
        self._bytes += sum(len(shot.raw) for shot in shots)
        self._kept[self._count] = Past(self._count, t_ns, robot_s, shots, prediction, revision=self._next())
        while len(self._kept) > _MOST or (self._bytes > _MOST_BYTES and len(self._kept) > 1):
            _, gone = self._kept.popitem(last=False)
            self._bytes -= sum(len(shot.raw) for shot in gone.shots)

    def tell(self, past: Past, labels: NDArray[np.int8] | None, frame_id: int, *, closed: bool) -> None:
        """What the learner said of it; None: nothing."""
        changed = closed != past.closed
        if labels is not None and (past.labels is None or not np.array_equal(labels, past.labels)):
            past.labels, changed = labels, True
        past.frame_id, past.closed = frame_id, closed
        if changed:
            past.revision = self._next()

    def since(self, revision: int) -> list[Past]:
        """Those that changed after this revision, oldest first."""
        return [past for past in self._kept.values() if past.revision > revision]

    @property
    def revision(self) -> int:
        """The newest."""
        return self._revision

    @property
    def oldest_key(self) -> int:
        """Of those kept; one that is to come, if none is."""
        return next(iter(self._kept), self._count + 1)

    def clear(self) -> None:
        """Forget them: another robot's time has begun."""
        self._kept.clear()
        self._bytes, self._last_ns = 0, None

    def _next(self) -> int:
        self._revision += 1
        return self._revision
