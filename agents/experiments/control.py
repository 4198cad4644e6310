"""Driving on predictions alone: collisions by minutes learned, and what avoiding does to the labels it learns from."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from agents.experiments.drives import Drive
from agents.experiments.driving import driving, living
from agents.experiments.findings import Claim, Findings, Plot
from agents.experiments.learning import Start
from agents.experiments.settings import HELD_OUT, changed, configuration_of, plain, robot_of, scenario, with_seed
from agents.experiments.statistics import mean, ratio
from agents.experiments.trial import Result, Trial
from llrp_online.configuration import RobotConfiguration
from llrp_online.figures.style import LINES, TEXT_PT, dress, new_figure

_REFLEX, _BLIND, _ORACLE = "the reflex", "random driving", "avoiding with true clearance"
#: Seeds of the layouts in which driving is judged, which no learner lived in and no exam is taken in.
_UNSEEN = 2 * HELD_OUT
_RATIO_BAR = 0.1
#: Ways to drive while learning: name -> (behaviour, changes of the configuration).
_LIVES: Mapping[str, tuple[str, Mapping[str, Any]]] = {
    "seeking": ("seek", {}),
    "avoiding": ("avoid", {}),
    "avoiding, no floor of positives": ("avoid", {"memory.positives_floor": 0.0}),
    "avoiding, twice the floor": ("avoid", {"memory.positives_floor": 0.4}),
    "avoiding, with approaches": ("curious", {}),
}


@dataclass(frozen=True)
class Size:
    """How much is run.

    Attributes:
        scenarios: each.
        seeds: of the learner's life and the layout it is judged in.
        learned_minutes: how long it has learned when it is judged; 0: not at all.
        minutes: of each judged drive.
        lived_scenarios: those of the part that drives while learning.
        lived_minutes: how long it does.
        budget_mb: of the memory then, so that it fills and must choose.
        exam_minutes: of the drives its weights are judged by.
    """

    scenarios: Sequence[str]
    seeds: Sequence[int]
    learned_minutes: Sequence[int]
    minutes: float
    lived_scenarios: Sequence[str]
    lived_minutes: int
    budget_mb: float
    exam_minutes: float


FULL = Size(("grass", "tiles", "wood"), (0, 1, 2), (0, 2, 5, 10), 10.0, ("grass", "wood"), 10, 24.0, 5.0)
QUICK = Size(("tiles",), (0,), (0, 1), 0.5, ("tiles",), 1, 24.0, 0.5)


def trials(size: Size) -> list[Trial]:
    """All of them."""
    return [trial for *_, trial in _judged(size)] + [trial for _, trial in _lived(size)]


def _judged(size: Size) -> Iterator[tuple[str, Trial]]:
    """Way of driving, trial."""
    usual = configuration_of("thymio")
    for name in size.scenarios:
        for seed in size.seeds:
            form = plain(with_seed(usual, seed))
            avoid = Drive(form, scenario(name), _UNSEEN + seed, size.minutes, "avoid")
            for minutes in size.learned_minutes:
                sight = asdict(_start(usual, name, seed, minutes)) if minutes else "untrained"
                yield _learned(minutes), driving(avoid, sight=sight)
            yield _ORACLE, driving(avoid, sight="truth")
            yield _REFLEX, driving(replace(avoid, behaviour="reflex"))
            yield _BLIND, driving(replace(avoid, behaviour="blind"))


def _lived(size: Size) -> Iterator[tuple[str, Trial]]:
    """Way of living, trial."""
    usual = changed(configuration_of("thymio"), {"memory.budget_mb": size.budget_mb})
    minutes = size.learned_minutes[len(size.learned_minutes) // 2]
    for life, (behaviour, changes) in _LIVES.items():
        for name in size.lived_scenarios:
            exam = [Drive(robot_of(usual), scenario(name), HELD_OUT + i, size.exam_minutes) for i in (0, 1)]
            for seed in size.seeds:
                form = plain(with_seed(changed(usual, changes), seed))
                drive = Drive(form, scenario(name), seed, float(size.lived_minutes), behaviour)
                yield life, living(drive, asdict(_start(usual, name, seed, minutes)), exam)


def _start(form: RobotConfiguration, name: str, seed: int, minutes: int) -> Start:
    lived = Drive(robot_of(form), scenario(name), seed, float(minutes), "seek")
    return Start(plain(with_seed(form, seed)), [lived])


def _learned(minutes: int) -> str:
    return f"avoiding after {minutes} min of learning"


def findings(size: Size, results: Sequence[Result]) -> Findings:
    """Collisions beside reflex, random driving and oracle; labels and AUC while it drives on what it learns."""
    judged: dict[str, list[Result]] = {}
    for (way, _), result in zip(_judged(size), results, strict=False):
        judged.setdefault(way, []).append(result)
    lived: dict[str, list[Result]] = {}
    for (life, _), result in zip(_lived(size), results[sum(map(len, judged.values())) :], strict=True):
        lived.setdefault(life, []).append(result)
    before = size.learned_minutes[len(size.learned_minutes) // 2]
    story = (
        f"A learner seeks in one layout of a scenario ({', '.join(size.scenarios)}; {len(size.seeds)} seeds each) for "
        f"0 to {size.learned_minutes[-1]} minutes; its weights then drive {size.minutes:g} minutes in a layout "
        "it never saw, on predictions alone (`avoid`), beside the proximity reflex, random driving, and the same "
        "controller given the true clearance. Second part: after "
        f"{before} minutes it drives for {size.lived_minutes} more while it learns, with a memory of "
        f"{size.budget_mb:g} MB, and what it predicts decides where it drives. Medians over runs, but for the claims "
        "that bars are set for and collisions by the way: those are of all runs together, since most runs have no "
        "collision and a median would hide those that do. Intervals resample runs."
    )
    return Findings(
        "control: driving on predictions",
        story,
        [*_driving_claims(size, judged), *_living_claims(lived)],
        {"driving": judged, "living": lived},
        [
            Plot(
                "collisions",
                _collisions(size, judged),
                "Collisions in ten minutes, by way of driving",
                "A dot a run, dots of equal runs one above the other; the bar is the mean.",
            ),
            Plot(
                "positives", _positives(lived), "Share of positive labels by minute, by way of driving while learning"
            ),
        ],
        list(_remarks(lived)),
    )


def _remarks(lived: Mapping[str, Sequence[Result]]) -> Iterator[str]:
    """What the same labels, learned from alike, say of the floor of positives."""
    usual, *floors = (lived[life] for life, (behaviour, _) in _LIVES.items() if behaviour == "avoid")
    if all(runs == usual for runs in floors):
        yield "No floor of positives changed a single number: in these lives none of them ever came to hold."


def _driving_claims(size: Size, judged: Mapping[str, Sequence[Result]]) -> Iterator[Claim]:
    count = {way: _per_ten_minutes(size, runs, "collisions") for way, runs in judged.items()}
    n = f"{len(count[_REFLEX])} runs: {len(size.scenarios)} scenarios x {len(size.seeds)} seeds"
    for way, runs in judged.items():
        for what in ("collisions", "metres"):
            yield Claim.median(f"{what} in 10 min, {way}", _per_ten_minutes(size, runs, what), n)
        a_way, interval = ratio([100 * run["collisions"] for run in runs], [run["metres"] for run in runs])
        yield Claim(f"collisions in 100 m, {way}", a_way, None, interval, n)
    last = count[_learned(size.learned_minutes[-1])]
    share, interval = ratio(last, count[_BLIND])
    beside_random = "collisions after the longest learning, as a share of random driving's"
    yield Claim(beside_random, share, _RATIO_BAR, interval, n, at_most=True)
    more, interval = mean(last - count[_REFLEX])
    beside_reflex = "collisions in 10 min after the longest learning, less the reflex's, mean"
    yield Claim(beside_reflex, more, 0.0, interval, n, at_most=True)


def _per_ten_minutes(size: Size, runs: Sequence[Result], what: str) -> NDArray[np.float64]:
    return np.array([run[what] for run in runs], np.float64) * 10 / size.minutes


def _living_claims(lived: Mapping[str, Sequence[Result]]) -> Iterator[Claim]:
    for life, runs in lived.items():
        n = f"{len(runs)} runs"
        half = len(runs[0]["minutes"]) // 2
        for part, name in ((slice(None, half), "first half"), (slice(half, None), "second half")):
            shares = [share for run in runs if (share := _positive_share(run["minutes"][part])) is not None]
            if shares:
                yield Claim.median(f"share of positive labels, {life}, {name}", shares, n)
        gains = [
            run["after"]["far"] - run["before"]["far"]
            for run in runs
            if None not in (run["after"]["far"], run["before"]["far"])
        ]
        if gains:
            yield Claim.median(f"AUC gained in that time, {life}", gains, n)
        a_minute = [float(np.mean([minute["collisions"] for minute in run["minutes"]])) for run in runs]
        yield Claim.median(f"collisions a minute, {life}", a_minute, n)


def _positive_share(minutes: Sequence[Result]) -> float | None:
    known = sum(minute["known_labels"] for minute in minutes)
    return sum(minute["positive_labels"] for minute in minutes) / known if known else None


def _collisions(size: Size, judged: Mapping[str, Sequence[Result]]) -> Figure:
    figure = new_figure(5.6, 0.7 + 0.34 * len(judged))
    axes = figure.add_subplot()
    for row, runs in enumerate(judged.values()):
        counts = sorted(_per_ten_minutes(size, runs, "collisions").tolist())
        above = [counts[:number].count(count) for number, count in enumerate(counts)]
        heights = [row - 0.3 + 0.7 * equal / len(counts) for equal in above]
        axes.plot(counts, heights, "o", color=LINES[0][0], markersize=3, markeredgewidth=0)
        axes.plot(np.mean(counts), row, "|", color=LINES[2][0], markersize=14, markeredgewidth=2)
    axes.set_yticks(range(len(judged)), list(judged))
    dress(axes, "collisions in ten minutes", "")
    axes.set_xscale("symlog", linthresh=5)
    return figure


def _positives(lived: Mapping[str, Sequence[Result]]) -> Figure:
    figure = new_figure(5.0, 3.2)
    axes = figure.add_subplot()
    alike: dict[str, list[str]] = {}  # lives in which all went the same are one line
    for life, runs in lived.items():
        same = next((first for first in alike if lived[first] == runs), life)
        alike.setdefault(same, []).append(life)
    for number, (life, names) in enumerate(alike.items()):
        runs = lived[life]
        colour, marker, dash = LINES[number % len(LINES)]
        shares = np.array(
            [[np.nan if (s := _positive_share([m])) is None else s for m in run["minutes"]] for run in runs]
        )
        known = ~np.isnan(shares).all(0)
        minutes = np.arange(1, shares.shape[1] + 1)[known]
        axes.plot(
            minutes,
            np.nanmedian(shares[:, known], 0),
            color=colour,
            marker=marker,
            linestyle=dash,
            markersize=4,
            label="; the same: ".join(names),
        )
    dress(axes, "minutes of driving while learning", "share of positive labels, median")
    axes.legend(fontsize=TEXT_PT, frameon=False)
    return figure
