"""What disturbs a learner that sees well: how far its AUC falls, and how soon learning brings it back."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from agents.experiments.bars import Estimate, paired_bars
from agents.experiments.curves import Marks, curves, time, values
from agents.experiments.disturbances import DISTURBANCES, Disturbance, Kind
from agents.experiments.drives import Drive
from agents.experiments.findings import Claim, Findings, Plot
from agents.experiments.learning import Start, learning
from agents.experiments.settings import (
    ELSEWHERE,
    HELD_OUT,
    changed,
    configuration_of,
    plain,
    robot_of,
    scenario,
    with_seed,
)
from agents.experiments.statistics import median, ratio
from agents.experiments.trial import Result, Trial

_USUAL = "undisturbed"
_POSE: Kind = "camera pose"
#: Under another camera pose, two more ways to begin: what was learned before may be of no help there.
_ALONE, _NOTHING = "begun without its memory", "begun from nothing"
#: Of what a new camera pose cost, so much is to be won back within three minutes.
_BAR, _BAR_S = 0.80, 180
#: What cost less than this is nothing to win back: the share would be noise over noise.
_LEAST_COST = 0.02


@dataclass(frozen=True)
class Size:
    """How much is run: `before` are the scenarios it has lived in, `scenarios` those it never saw.

    The latter have no chairs: a camera on a high mast would stick through their seats.
    """

    before: Sequence[str]
    before_minutes: float
    scenarios: Sequence[str]
    seeds: Sequence[int]
    marks_s: Sequence[float]
    held_out_minutes: float
    disturbances: Sequence[str]


FULL = Size(
    ("carpet", "concrete", "stone", "wood"),
    5.0,
    ("grass", "tiles"),
    (0, 1, 2),
    (0, 30, 60, 120, 180),
    4.0,
    tuple(DISTURBANCES),
)
QUICK = Size(
    ("wood",), 0.5, ("tiles",), (0,), (0, 15, 30), 0.5, ("camera at 60 cm", "half as bright", "a walking person")
)


def trials(size: Size) -> list[Trial]:
    """All of them."""
    return [trial for _, trial in _named(size)]


def _named(size: Size) -> Iterator[tuple[str, Trial]]:
    """Disturbance, with how it begins if not as usual, and trial.

    The seed changes fastest, so that processes do not wait for each other's first life.
    """
    usual = configuration_of("thymio")
    robot, first = robot_of(usual), changed(usual, ELSEWHERE)
    for name in (_USUAL, *size.disturbances):
        disturbance = DISTURBANCES.get(name, Disturbance("world"))
        other = robot_of(changed(usual, disturbance.robot))
        for floor in size.scenarios:
            arena = disturbance.arena(scenario(floor))
            held_out = [Drive(other, arena, HELD_OUT + layout, size.held_out_minutes) for layout in (0, 1)]
            for seed in size.seeds:
                form = with_seed(usual, seed)
                before = [Drive(robot, scenario(old), seed, size.before_minutes, "seek") for old in size.before]
                lived = [Drive(other, arena, seed, size.marks_s[-1] / 60, "seek")]
                exams, start = {"here": held_out}, Start(plain(with_seed(first, seed)), before)
                yield name, learning(form, lived, exams, size.marks_s, start=start)
                if disturbance.kind == _POSE:
                    alone = replace(start, memory=False)
                    yield f"{name}, {_ALONE}", learning(form, lived, exams, size.marks_s, start=alone)
                    yield f"{name}, {_NOTHING}", learning(form, lived, exams, size.marks_s)


@dataclass(frozen=True)
class Outcome:
    """What one disturbance did, a value each run with no blank; AUC of the learner that was never disturbed beside it.

    Attributes:
        cost: (N,) how far the AUC falls at once.
        gain: (N,) how far above that fallen AUC it is at the last mark.
        left: (N,) how far it then is below the learner that learned as long undisturbed.
    """

    cost: NDArray[np.float64]
    gain: NDArray[np.float64]
    left: NDArray[np.float64]

    @classmethod
    def of(
        cls, disturbed: NDArray[np.float64], usual: NDArray[np.float64], last: NDArray[np.float64] | None = None
    ) -> "Outcome":
        """From the AUC (runs, marks) of both, paired by run; runs with a blank at the first or last mark are left out.

        Another learner's AUC at the last mark may take the place of the disturbed one's: `last` (runs,).

        >>> Outcome.of(np.array([[0.6, 0.8]]), np.array([[0.9, 0.95]])).left.round(2).tolist()
        [0.15]
        """
        reached = disturbed[:, -1] if last is None else last
        ends = np.stack([disturbed[:, 0], reached, usual[:, 0], usual[:, -1]])
        first, reached, usual_first, usual_last = ends[:, ~np.isnan(ends).any(0)]
        return cls(usual_first - first, reached - first, usual_last - reached)

    def won_back(self) -> Estimate | None:
        """The gain over the cost; None where that is too small."""
        return self._share(self.gain)

    def caught_up(self) -> Estimate | None:
        """The same, less what undisturbed learning gained meanwhile; None where the cost is too small."""
        return self._share(self.cost - self.left)

    def _share(self, part: NDArray[np.float64]) -> Estimate | None:
        if not len(self.cost) or np.median(self.cost) <= _LEAST_COST:
            return None
        value, interval = ratio(part, self.cost)
        return None if value is None or interval is None else (value, interval)


def findings(size: Size, results: Sequence[Result]) -> Findings:
    """Falls, and what is won back, by disturbance."""
    runs: dict[str, list[Marks]] = {}
    for (name, _), result in zip(_named(size), results, strict=True):
        runs.setdefault(name, []).append(result["marks"])
    usual = values(runs[_USUAL], "here")
    outcomes = {name: Outcome.of(values(runs[name], "here"), usual) for name in size.disturbances}
    end = time(size.marks_s[-1])
    story = (
        f"A learner lives {size.before_minutes:g} minutes in each of {', '.join(size.before)}, seeking, "
        "the colours of half the pictures it learns from turned (`augmentation.colour`). Then "
        f"something changes, in scenarios it never saw ({', '.join(size.scenarios)}; {len(size.seeds)} seeds each), "
        f"and it goes on learning for {end}. Mean AUC at 0 to 25 cm on two held-out layouts with the same disturbance, "
        f"{size.held_out_minutes:g} minutes each. The fall is the difference at once from the same learner undisturbed "
        f"there; what is left, the difference after {end} from that learner having learned as long. The share won back "
        "is the rise under the disturbance over the fall; net of learning, less the rise without disturbance. Shares "
        f"are of sums over runs, and blank where the median fall is no more than {_LEAST_COST:g}. Under another camera "
        "pose two more learners live the same minutes: one begins with the old weights alone, one with random weights. "
        "Values are medians over runs, intervals resample runs."
    )
    return Findings(
        "robustness: what disturbs it, and how soon it recovers",
        story,
        [
            *_undisturbed(size, usual),
            *(claim for name in outcomes for claim in _claims(size, name, outcomes[name])),
            *_otherwise(size, runs, usual),
        ],
        {"runs": runs, "won_back_by_mark": _by_mark(size, runs, usual)},
        [_bars(outcomes, end), *_recoveries(runs)],
        _remarks(size),
    )


def _undisturbed(size: Size, usual: NDArray[np.float64]) -> Iterator[Claim]:
    for when, column in (("at once", usual[:, 0]), (f"after {time(size.marks_s[-1])}", usual[:, -1])):
        yield Claim.median(f"{_USUAL}: mean AUC {when}", column, _runs(size))


def _claims(size: Size, name: str, outcome: Outcome) -> Iterator[Claim]:
    end, n = time(size.marks_s[-1]), _runs(size)
    bar = _BAR if DISTURBANCES[name].kind == _POSE and size.marks_s[-1] == _BAR_S else None
    yield Claim.median(f"{name}: fall at once", outcome.cost, n)
    yield Claim.median(f"{name}: left after {end}", outcome.left, n)
    n = n.format(len(outcome.cost))
    yield _claim(f"{name}: share won back after {end}", outcome.won_back(), bar, n)
    yield _claim(f"{name}: share won back after {end}, net of learning", outcome.caught_up(), bar, n)


def _otherwise(size: Size, runs: Mapping[str, Sequence[Marks]], usual: NDArray[np.float64]) -> Iterator[Claim]:
    """What a learner that begins otherwise wins back of the same fall."""
    end = time(size.marks_s[-1])
    for name in size.disturbances:
        for way in (_ALONE, _NOTHING) if DISTURBANCES[name].kind == _POSE else ():
            last = values(runs[f"{name}, {way}"], "here")[:, -1]
            outcome = Outcome.of(values(runs[name], "here"), usual, last)
            what = f"{name}, {way}: share won back after {end}"
            yield _claim(what, outcome.won_back(), None, _runs(size).format(len(outcome.cost)))


def _claim(what: str, found: Estimate | None, bar: float | None, n: str) -> Claim:
    value, interval = (None, None) if found is None else found
    return Claim(what, value, bar, interval, n)


def _runs(size: Size) -> str:
    return f"{{}} runs: {len(size.scenarios)} scenarios x {len(size.seeds)} seeds"


def _by_mark(
    size: Size, runs: Mapping[str, Sequence[Marks]], usual: NDArray[np.float64]
) -> dict[str, list[float | None]]:
    """Disturbance -> share won back by each mark after the first."""
    found: dict[str, list[float | None]] = {}
    for name in size.disturbances:
        disturbed, marks = values(runs[name], "here"), range(2, len(size.marks_s) + 1)
        shares = [Outcome.of(disturbed[:, :mark], usual[:, :mark]).won_back() for mark in marks]
        found[name] = [None if share is None else share[0] for share in shares]
    return found


def _bars(outcomes: Mapping[str, Outcome], end: str) -> Plot:
    pairs = {
        name: (median(outcome.cost), median(outcome.left)) if len(outcome.cost) else (None, None)
        for name, outcome in outcomes.items()
    }
    drawn = paired_bars(pairs, ("fall at once", f"left after {end}"), "mean AUC, 0 to 25 cm: below undisturbed")
    return Plot("falls", drawn, f"How far the AUC falls by disturbance, and what is left of it after {end}")


def _recoveries(runs: Mapping[str, Sequence[Marks]]) -> Iterator[Plot]:
    """A figure a kind of disturbance; and the ways to begin, all camera poses together."""
    poses = [name for name in runs if name in DISTURBANCES and DISTURBANCES[name].kind == _POSE]
    for kind in get_args(Kind):
        found = {name: runs[name] for name in runs if name in DISTURBANCES and DISTURBANCES[name].kind == kind}
        if found:
            drawn = curves({_USUAL: runs[_USUAL], **found}, "here")
            name = f"recovery_{kind.replace(' ', '_')}"
            yield Plot(name, drawn, f"Median AUC by robot minutes under disturbance: {kind}")
    if poses:
        ways = {way: [m for name in poses for m in runs[f"{name}, {way}"]] for way in (_ALONE, _NOTHING)}
        together = {"begun with its memory": [m for name in poses for m in runs[name]], **ways}
        alt = "Median AUC by robot minutes under another camera pose, by how the learner begins"
        yield Plot("ways_to_begin", curves(together, "here"), alt, f"Together: {', '.join(poses)}.")


def _remarks(size: Size) -> list[str]:
    """What the disturbances are, where their names do not say it, and what the simulation leaves out."""
    said = {
        "camera at 60 cm": "At 60 cm the camera looks down by 58.4 deg, at 95 cm by 59.6 (usual: 12 cm and 46 deg): "
        "the picture's lower edge still meets the floor 3.4 cm before the camera, and its upper edge lies farther "
        "ahead. The simulated robot never sees itself.",
        "pitch 10 deg steeper": "With a pitch 10 deg steeper the picture ends 23 cm ahead of the sensors, where "
        "targets to 25 cm and sensors that reach 10 cm would need 35: part of the fall is out of sight for good.",
        "out of focus": "Out of focus: a Gaussian of 1.5 px on pictures of 80 x 64. Smeared by motion: the shutter is "
        "open for the whole 50 ms between two ticks.",
        "hard shadows": "Hard shadows: the lamp 25 deg high, 3 m away, 1.6 strong, ambient light 0.13.",
        "a walking person": "The person's legs glide at 0.3 m/s, keep 6 cm from the robot and go elsewhere after 2 s. "
        "Labels take the world for still, so this drive's labels contradict each other, in learning and in the "
        "held-out layouts; the robot's way is another, too, unlike under all other disturbances.",
    }
    return [text for name, text in said.items() if name in size.disturbances]
