"""A new floor: warm-started from eight scenarios, with and without the memory, beside frozen, from nothing, an oracle.

Then five floors in a row (`adapt_row`).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from agents.experiments import adapt_row
from agents.experiments.adapt_row import Row
from agents.experiments.curves import Marks, curves, time, values
from agents.experiments.drives import Drive
from agents.experiments.findings import Claim, Findings, Plot
from agents.experiments.learning import FAR_M, Start, learning
from agents.experiments.settings import (
    ELSEWHERE,
    HELD_OUT,
    changed,
    configuration_of,
    plain,
    robot_of,
    scenario,
    scenarios,
    with_seed,
)
from agents.experiments.training import training
from agents.experiments.trial import Result, Trial
from llrp_online.metrics import Score
from llrp_online.scoring import mean_auc

_WARM, _FORGETFUL, _FROZEN, _SCRATCH = "warm start with memory", "warm start, weights alone", "frozen", "from nothing"
_RECENT = "warm start, nine tenths of a batch recent"
_ORACLE = "offline oracle of the floor"
#: Of the oracle's AUC, so much is to be reached within a minute.
_ORACLE_BAR, _ORACLE_S = 0.95, 60


@dataclass(frozen=True)
class Size:
    """How much is run.

    Attributes:
        old: floors of the first life.
        old_minutes: on each of them.
        new: floors that it is then moved to, each apart.
        seeds: of layouts, noise and weights.
        marks_s: when it is tried, from the move on.
        new_held_out_minutes: of drives on two held-out layouts of the new floor.
        old_held_out_minutes: of a drive on one held-out layout of each old floor.
        oracle_steps: of training.
        row: of the second part.
    """

    old: Sequence[str]
    old_minutes: float
    new: Sequence[str]
    seeds: Sequence[int]
    marks_s: Sequence[float]
    new_held_out_minutes: float
    old_held_out_minutes: float
    oracle_steps: int
    row: Row


FULL = Size(
    scenarios()[:8],
    5.0,
    scenarios()[8:],
    (0, 1, 2),
    (0, 15, 30, 60, 120, 180, 300, 600),
    2.5,
    1.0,
    6_000,
    Row(scenarios()[::2], (0, 1, 2), 5.0, 1.5),
)
QUICK = Size(("wood",), 0.5, ("tiles",), (0,), (0, 15, 30), 0.5, 0.5, 40, Row(("tiles", "wood"), (0,), 0.5, 0.5))


def trials(size: Size) -> list[Trial]:
    """All of them."""
    return [*(trial for _, trial in _named(size)), *(trial for _, trial in adapt_row.named(size.row))]


def _named(size: Size) -> Iterator[tuple[str, Trial]]:
    """Form and trial of the first part."""
    usual = configuration_of("thymio")
    robot, recent = robot_of(usual), changed(usual, {"memory.recent_share": 0.9})
    first = changed(usual, ELSEWHERE)
    old_exam = [Drive(robot, scenario(name), HELD_OUT, size.old_held_out_minutes) for name in size.old]
    for floor in size.new:
        arena, ends = scenario(floor), (size.marks_s[0], size.marks_s[-1])
        held_out = [Drive(robot, arena, HELD_OUT + layout, size.new_held_out_minutes) for layout in (0, 1)]
        exams = {"new": held_out, "old": old_exam}
        all_lived = {seed: Drive(robot, arena, seed, size.marks_s[-1] / 60, "seek") for seed in size.seeds}
        for seed, lived in all_lived.items():
            form = with_seed(usual, seed)
            before = [Drive(robot, scenario(name), seed, size.old_minutes, "seek") for name in size.old]
            start = Start(plain(with_seed(first, seed)), before)
            alone = replace(start, memory=False)
            yield _WARM, learning(form, [lived], exams, size.marks_s, start=start)
            yield _FORGETFUL, learning(form, [lived], exams, size.marks_s, start=alone)
            yield _RECENT, learning(with_seed(recent, seed), [lived], exams, size.marks_s, start=start)
            yield _FROZEN, learning(form, [lived], exams, ends, start=start, frozen=True)
            yield _SCRATCH, learning(form, [lived], exams, size.marks_s)
            yield _ORACLE, training(form, list(all_lived.values()), {"new": held_out}, size.oracle_steps)


def findings(size: Size, results: Sequence[Result]) -> Findings:
    """AUC on the new floor and on the old ones, at each mark; and the row."""
    runs: dict[str, list[Marks]] = {}
    oracle: list[float] = []
    first = list(_named(size))
    for (form, _), result in zip(first, results[: len(first)], strict=True):
        if form == _ORACLE:
            oracle.append(mean_auc(Score.of_json(result["new"]["score"]), FAR_M)[0])
        else:
            runs.setdefault(form, []).append(result["marks"])
    row: dict[str, list[Result]] = {}
    for (form, _), result in zip(adapt_row.named(size.row), results[len(first) :], strict=True):
        row.setdefault(form, []).append(result)
    told = [None if np.isnan(auc) else auc for auc in oracle]
    return Findings(
        "adapt: a new floor",
        _story(size),
        [*_claims(size, runs, np.array(oracle)), *adapt_row.claims(size.row, row)],
        {"runs": runs, "oracle": told, "row": row},
        [
            Plot("new_floor", curves(runs, "new"), "Median AUC on the new floor by robot minutes"),
            Plot("old_floors", curves(runs, "old"), "Median AUC on the old floors by robot minutes"),
        ],
        tables=[adapt_row.table(size.row, row[adapt_row.USUAL])],
    )


def _story(size: Size) -> str:
    return (
        f"A learner lives {size.old_minutes:g} minutes on each of {len(size.old)} floors ({', '.join(size.old)}), "
        "the colours of half the pictures it learns from turned (`augmentation.colour`), "
        f"then moves to one it never saw ({', '.join(size.new)}; {len(size.seeds)} seeds each); it seeks throughout. "
        f"Mean AUC at 0 to 25 cm on two held-out layouts of the new floor, {size.new_held_out_minutes:g} minutes each, "
        f"and on one of each old floor, {size.old_held_out_minutes:g} minutes each. The oracle learns offline, "
        f"{size.oracle_steps:,} steps, from the drives of all seeds on the new floor, {len(size.seeds)} x "
        f"{size.marks_s[-1] / 60:g} minutes. Then a learner lives {size.row.minutes:g} minutes each on "
        f"{', '.join(size.row.stages)}, in a row, {len(size.row.seeds)} seeds. Forward transfer: AUC on a floor just "
        "before it is lived on, over random weights there. Backward transfer: AUC on earlier floors at the end of the "
        "row, over just after each. Forgotten: the best AUC on a floor in the row less that at its end. An alarm "
        "within two minutes of a change is the change's, any other false; what a frame's prediction was worth is known "
        f"when its label window closes, {configuration_of('thymio').labels.window_s:g} s later. Values are medians "
        "over runs, intervals resample runs."
    )


def _claims(size: Size, runs: Mapping[str, Sequence[Marks]], oracle: NDArray[np.float64]) -> Iterator[Claim]:
    n = "{} runs: " + f"{len(size.new)} floors x {len(size.seeds)} seeds"
    new, marks_s = values(runs[_WARM], "new"), [int(mark_s) for mark_s in size.marks_s]
    for mark_s, column in zip(marks_s, new.T, strict=True):
        when = "at once" if mark_s == 0 else f"after {time(mark_s)}"
        yield Claim.median(f"new floor, {when}", column, n, {0: 0.87, 180: 0.91}.get(mark_s))
    deepest = (new[:, :1] - new).max(1)
    yield Claim.median("new floor: deepest fall below the start", deepest, n, 0.02, at_most=True)
    worst = None if np.isnan(deepest).any() else float(deepest.max())
    yield Claim("new floor: deepest fall of any run", worst, 0.02, None, f"{len(deepest)} runs", True)
    yield Claim.median(_ORACLE, oracle, n)
    if _ORACLE_S in marks_s:
        share = new[:, marks_s.index(_ORACLE_S)] / oracle
        yield Claim.median(f"share of the oracle's AUC after {time(_ORACLE_S)}", share, n, _ORACLE_BAR)
    for form in (_WARM, _RECENT, _FORGETFUL):
        old = values(runs[form], "old")
        bar = 0.005 if form == _WARM else None
        yield Claim.median(f"lost on the old floors, {form}", old[:, 0] - old[:, -1], n, bar, at_most=True)
    for form in (_RECENT, _FORGETFUL, _FROZEN, _SCRATCH):
        yield Claim.median(f"new floor at the end, {form}", values(runs[form], "new")[:, -1], n)
    sooner = values(runs[_RECENT], "new") - new
    for mark_s, column in list(zip(marks_s, sooner.T, strict=True))[1:]:
        what = f"new floor, after {time(mark_s)}: gained by nine tenths of a batch recent"
        yield Claim.median(what, column, n)
