"""What each window of the label rule gives on recordings, and which one to take: the answer of `llrp window`."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from agents.progress import track
from llrp_online import windows
from llrp_online.configuration import RobotConfiguration
from llrp_online.figures import WindowPanel
from llrp_online.windows import DRIFT, Tally
from replay.resolution import Drive, resolve
from replay.rule import LabelRule
from replay.sightings import Sightings, sightings

#: Labels that are worth less than this share of their number are no better than chance would have them.
_SOUND = 0.1


@dataclass(frozen=True)
class Row:
    """One window.

    Attributes:
        window: its name.
        window_s: longest time between frame and reading; None where there is no limit.
        known: labels a frame.
        positive: labels a frame.
        agreeing: share of the bits felt twice at a place within the window that agree; None of none.
        felt_twice: how many these are.
        worth: faultless labels a frame that the known ones are worth, see `llrp_online.windows`; None: cannot be told.
        prequential_auc: of a learner that lives through the recordings, by its own labels; None: not asked for, or
            undefined.
    """

    window: str
    window_s: float | None
    known: float
    positive: float
    agreeing: float | None
    felt_twice: int
    worth: float | None
    prequential_auc: float | None = None


@dataclass(frozen=True)
class Answer:
    """All windows.

    Attributes:
        frames: with a pose.
        rows: the fixed windows, ascending, then `drift`.
        recommended: name of one of the fixed ones; None where nothing tells, or none is any good.
    """

    frames: int
    rows: list[Row]
    recommended: str | None

    @property
    def fixed(self) -> list[Row]:
        """Without `drift`."""
        return [row for row in self.rows if row.window != DRIFT]

    @property
    def drift(self) -> Row:
        """What the drift window gives."""
        return self.rows[-1]

    def scored(self, prequential_auc: Mapping[str, float | None]) -> "Answer":
        """With the score of a learner of each window."""
        rows = [replace(row, prequential_auc=prequential_auc[row.window]) for row in self.rows]
        return replace(self, rows=rows)

    def sentence(self) -> str:
        """The answer, for who asked."""
        drift = self.drift
        known = f"`drift` knows {drift.known:.1f} labels a frame"
        if self.recommended is None and any(row.worth is not None for row in self.fixed):
            return (
                "No window can be recommended: what the robot feels when it comes back to a place, by its odometry, "
                "hardly agrees beyond chance with what it felt there, even soon after. Look at the tolerances, the "
                f"odometry and the sensors' thresholds (`llrp check`). {known}."
            )
        if self.recommended is None:
            most = max(row.felt_twice for row in self.fixed)
            return (
                "No window can be recommended: the robot came back to too few places to tell how long its odometry "
                f"holds ({most} bits felt twice, expected at least {windows.FEWEST} at one age, some of them 1); let "
                f"it drive over the same places again, with something to feel. {known}."
            )
        best = next(row for row in self.fixed if row.window == self.recommended)
        advice = "leave the window without a limit" if best.window_s is None else f"labels.window_s = {best.window_s:g}"
        share = "" if best.agreeing is None else f", and {100 * best.agreeing:.1f} % of what it felt twice agrees"
        agreeing = "" if drift.agreeing is None else f", and {100 * drift.agreeing:.1f} % agrees"
        return (
            f"Take {advice}: it knows {best.known:.1f} labels a frame{share}; {known}{agreeing}, and is worth "
            f"{_beside(drift.worth, best.worth)}."
        )

    def panel(self, title: str) -> WindowPanel:
        """For the picture."""
        fixed = self.fixed
        names = [row.window for row in fixed]
        place = None if self.recommended is None else names.index(self.recommended)
        drift = self.drift.known, self.drift.agreeing
        return WindowPanel(title, names, [row.known for row in fixed], [row.agreeing for row in fixed], drift, place)

    def as_json(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "frames": self.frames,
            "recommended": self.recommended,
            "sentence": self.sentence(),
            "windows": [asdict(row) for row in self.rows],
        }


def compare(configuration: RobotConfiguration, drives: Sequence[Drive]) -> Answer:
    """Label drives by every window; ValueError if no label becomes known under any of them."""
    targets, streams = configuration.targets.build(), list(configuration.streams.values())
    rule, limits, noise = configuration.labels.rule(), configuration.odometry.limits(), configuration.odometry.noise()
    longest_s = max(_span_s(drive) for drive in drives)
    compared = windows.rules(rule, longest_s)
    tallies = {
        name: Tally.together([Tally.of(resolve(d, targets, streams, one, limits, noise), streams) for d in drives])
        for name, one in track(compared.items(), "labelling by each window", len(compared))
    }
    if not any(tally.known for tally in tallies.values()):
        raise ValueError(
            f"no label became known under any window, from {sum(len(d.frames_ns) for d in drives)} frames: expected "
            "readings within the tolerances of a target. See `llrp check` for the likely cause"
        )
    seen = [sightings(d, streams, rule, limits, noise) for d in track(drives, "looking for revisits", len(drives))]
    return _answer(compared, tallies, seen)


def learner_of(configuration: RobotConfiguration, window: str) -> RobotConfiguration:
    """The same with the window of that name."""
    rule = windows.rules(configuration.labels.rule())[window]
    labels = configuration.labels.model_copy(update={"window": rule.window, "window_s": rule.window_s})
    return configuration.model_copy(update={"labels": labels})


def _answer(compared: Mapping[str, LabelRule], tallies: Mapping[str, Tally], seen: Iterable[Sightings]) -> Answer:
    parts = list(seen)
    drift = compared[DRIFT]
    every = sum((windows.felt_twice(part) for part in parts[1:]), windows.felt_twice(parts[0]))
    gated = sum((windows.felt_twice(p, drift.gate_m) for p in parts[1:]), windows.felt_twice(parts[0], drift.gate_m))
    by_age = windows.correlations(every)
    rows: list[Row] = []
    for name, rule in compared.items():
        tally, counts = tallies[name], gated if rule.window == "drift" else every
        # Where too little was felt twice within the gate, what was felt without it is the nearest to go by.
        ages = windows.correlations(counts)
        ages = by_age if ages is None else ages
        share, felt = windows.agreement(counts, rule)
        positive = tally.positive / max(tally.frames, 1)
        limit = None if rule.window_s == windows.UNLIMITED_S else rule.window_s
        worth = None if ages is None else windows.worth(tally, ages)
        rows.append(Row(name, limit, tally.per_frame, positive, share, felt, worth))
    worths = {row.window: row.worth for row in rows[:-1] if row.worth is not None}
    sound = any(row.worth is not None and row.worth >= _SOUND * row.known for row in rows[:-1])
    return Answer(tallies[DRIFT].frames, rows, windows.recommended(worths) if sound else None)


def _beside(worth: float | None, other: float | None) -> str:
    """How much of the best fixed window's worth.

    >>> _beside(55.0, 50.0), _beside(10.0, 0.0)
    ('110 % of that', 'more')
    """
    if worth is None or not other:
        return "more" if worth else "as much"
    return f"{100 * worth / other:.0f} % of that"


def _span_s(drive: Drive) -> float:
    times = np.concatenate([drive.odometry_ns, drive.readings_ns, drive.frames_ns])
    return float(times.max() - times.min()) * 1e-9
