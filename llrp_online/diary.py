"""What a learner's robot minutes were like: a few numbers noted as each ends, and what is worked out when asked for.

How well a minute was predicted is known only once its labels are; so its score is not noted but taken from the
prequential window when somebody asks, and kept when it can change no more. A learner that nobody asks does nothing.
"""

from dataclasses import dataclass, field
from typing import Any, NamedTuple

from llrp_online.prequential import Band, Prequential

_MINUTE_S = 60.0
#: A score with intervals takes some hundredths of a second, and sensors wait meanwhile: so many at one asking.
_AT_ONCE = 2
#: So much of a minute that is not over says something.
_TELLING_S = 20.0


class Totals(NamedTuple):
    """What a learner has counted since it began: see `LearnerStatus`; `loss` is the sum over all steps."""

    frame_id: int
    known: int
    positives: int
    steps: int
    loss: float
    version: int
    rejected: int


class Interval(NamedTuple):
    """A band's score over a minute, with the ends of the 95 % interval of its AUC; None where undefined."""

    band: Band
    low: float | None
    high: float | None


@dataclass
class Entry:
    """A stretch of robot time: a whole minute, or what has passed of one.

    Attributes:
        start_s: of the robot's life.
        end_s: of the robot's life.
        before: at its start.
        after: at its end.
        bands: near to far; None while nobody has asked, empty if the prequential window held none of its frames.
        scored_s: the robot's life when `bands` were worked out.
    """

    start_s: float
    end_s: float
    before: Totals
    after: Totals
    bands: list[Interval] | None = None
    scored_s: float = field(default=-1.0)

    def as_json(self) -> dict[str, Any]:
        """Its own numbers, not the sums since the beginning."""
        steps = self.after.steps - self.before.steps
        return {
            "start_s": self.start_s,
            "end_s": self.end_s,
            "frames": self.after.frame_id - self.before.frame_id,
            "known": self.after.known - self.before.known,
            "positives": self.after.positives - self.before.positives,
            "steps": steps,
            "loss": (self.after.loss - self.before.loss) / steps if steps > 0 else None,
            "version": self.after.version,
            "published": self.after.version - self.before.version,
            "rejected": self.after.rejected - self.before.rejected,
            "bands": None
            if self.bands is None
            else [{**b._asdict(), "low": lo, "high": hi} for b, lo, hi in self.bands],
        }


class Diary:
    """One entry a robot minute.

    Args:
        settle_s: this long after a minute its labels change no more.

    >>> diary = Diary(settle_s=10.0)
    >>> nothing = Totals(0, 0, 0, 0, 0.0, 0, 0)
    >>> for lived_s in (0.0, 30.0, 60.0, 61.0):
    ...     if diary.is_due(lived_s):
    ...         diary.note(lived_s, nothing._replace(steps=int(lived_s)))
    >>> [(entry.end_s, entry.as_json()["steps"]) for entry in diary.entries]
    [(60.0, 60)]
    """

    def __init__(self, settle_s: float) -> None:
        self.entries: list[Entry] = []
        self._settle_s = settle_s
        self._start: tuple[float, Totals] | None = None

    def is_due(self, lived_s: float) -> bool:
        """Has a minute begun or ended?"""
        return self._start is None or lived_s // _MINUTE_S > self._start[0] // _MINUTE_S

    def note(self, lived_s: float, now: Totals) -> None:
        """The minute is over, and the next begins."""
        if self._start is not None:
            self.entries.append(Entry(self._start[0], lived_s, self._start[1], now))
        self._start = lived_s, now

    def score(self, prequential: Prequential, lived_s: float, now: Totals, rounds: int = 100) -> list[Entry]:
        """All entries, with the minute that is not over yet as the last, once a good part of it has passed.

        Those scores that may have changed the longest ago are worked out anew, a few at one asking.
        """

        def work_out(entry: Entry) -> None:
            first, end = entry.before.frame_id, entry.after.frame_id
            found = [Interval(*interval) for interval in prequential.intervals(first, end, rounds)]
            entry.bands = found or entry.bands or []
            entry.scored_s = lived_s

        open_ = [entry for entry in self.entries if entry.scored_s < entry.end_s + self._settle_s]
        for entry in sorted(open_, key=lambda entry: (entry.scored_s, -entry.end_s))[:_AT_ONCE]:
            work_out(entry)
        if self._start is None or lived_s - self._start[0] < _TELLING_S:
            return list(self.entries)
        running = Entry(self._start[0], lived_s, self._start[1], now)
        work_out(running)
        return [*self.entries, running]
