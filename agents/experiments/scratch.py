"""From nothing: how soon the online learner sees, in each scenario, by controller and by steps a second."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from agents.experiments import ablate
from agents.experiments.curves import METRES, STEPS, Marks, curves, time, values
from agents.experiments.drives import Drive
from agents.experiments.findings import Claim, Findings, Plot
from agents.experiments.learning import learning
from agents.experiments.settings import HELD_OUT, changed, configuration_of, robot_of, scenario, scenarios, with_seed
from agents.experiments.statistics import median
from agents.experiments.trial import Result, Trial
from llrp_online.configuration import RobotConfiguration

_USUAL = "seeking, as configured"
_REACH = {"far": "0 to 25 cm", "near": "0 to 15 cm"}
#: (part, seconds) -> AUC to reach.
_BARS = {("far", 180): 0.80, ("far", 300): 0.87, ("far", 600): 0.92, ("near", 600): 0.95}
_WORST_BAR = 0.87
#: Held-out layouts of a scenario.
_LAYOUTS = 3


@dataclass(frozen=True)
class Size:
    """How much is run: every scenario and seed in the usual form, the first three scenarios in the other forms."""

    scenarios: Sequence[str]
    seeds: Sequence[int]
    marks_s: Sequence[float]
    held_out_minutes: float
    rates: Sequence[float]


FULL = Size(scenarios(), (0, 1, 2), (30, 60, 120, 180, 300, 600), 2.0, (2.0, 10.0))
QUICK = Size(("tiles",), (0,), (15, 30), 1.0, (10.0,))


def trials(size: Size) -> list[Trial]:
    """All of them."""
    return [trial for _, _, trial in _named(size)]


def _named(size: Size) -> Iterator[tuple[str, str, Trial]]:
    """Form, scenario, trial."""
    usual = configuration_of("thymio")
    control = usual.control
    quick = {"control.speed_m_s": control.seek_speed_m_s, "control.turn_rad_s": control.seek_turn_rad_s}
    for name in size.scenarios:
        for seed in size.seeds:
            yield _USUAL, name, _trial(size, usual, name, seed)
    for name in size.scenarios[:3]:
        for seed in size.seeds:
            yield "the paper's acquisition", name, _trial(size, usual, name, seed, "explore")
            yield "the paper's acquisition, as fast", name, _trial(size, changed(usual, quick), name, seed, "explore")
            yield "random walk, as fast", name, _trial(size, changed(usual, quick), name, seed, "walk")
            for rate in size.rates:
                form = changed(usual, {"training.steps_per_second": rate})
                yield f"seeking, {rate:g} steps a second", name, _trial(size, form, name, seed)


def _trial(size: Size, form: RobotConfiguration, name: str, seed: int, behaviour: str = "seek") -> Trial:
    # A drive is told by what the robot is, not by how it learns, so that forms share it; exams are the same for all.
    arena, examiner = scenario(name), robot_of(configuration_of("thymio"))
    lived = Drive(robot_of(form), arena, seed, size.marks_s[-1] / 60, behaviour)
    held_out = [Drive(examiner, arena, HELD_OUT + layout, size.held_out_minutes) for layout in range(_LAYOUTS)]
    return learning(with_seed(form, seed), [lived], {"new": held_out}, size.marks_s)


def findings(size: Size, results: Sequence[Result]) -> Findings:
    """Medians over runs at each mark, beside the bars."""
    runs: dict[str, dict[str, list[Marks]]] = {}
    for (form, name, _), result in zip(_named(size), results, strict=True):
        runs.setdefault(form, {}).setdefault(name, []).append(result["marks"])
    usual = [marks for found in runs[_USUAL].values() for marks in found]
    first = ", ".join(size.scenarios[:3])
    compared = {form: [m for name in size.scenarios[:3] for m in found[name]] for form, found in runs.items()}
    story = (
        f"The learner begins with random weights in each of {len(size.scenarios)} scenarios, {len(size.seeds)} seeds "
        "each (layout, noise, weights), while the robot seeks; its weights are tried as they are at each mark on "
        f"{_LAYOUTS} other layouts of the same scenario, {size.held_out_minutes:g} minutes each, driven as the "
        "paper's robot acquires its data, whatever the robot that learns does. `As fast` is at the speeds of seeking. "
        "Mean AUC is over the cells (target x sensor) with at least ten known labels of each class; values are medians "
        "over runs, intervals resample scenarios (with all their seeds), pairs where forms are compared."
    )
    return Findings(
        "scratch: from nothing",
        story,
        [*_medians(size, runs[_USUAL]), *_worst(runs[_USUAL]), *_untouched(size, runs[_USUAL]), *_by_form(compared)],
        runs,
        [
            Plot("learning_curve", curves({_USUAL: usual}, "new"), "Median AUC by robot minutes, all scenarios"),
            Plot("by_metres", curves({_USUAL: usual}, "new", METRES), "Median AUC by metres driven, all scenarios"),
            Plot(
                "by_steps",
                curves({_USUAL: usual}, "new", STEPS),
                "Median AUC by training steps, all scenarios",
                "What a step takes in seconds of computing: docs/BENCHMARKS.md, and AUC against those seconds there.",
            ),
            Plot("forms", curves(compared, "new"), "Median AUC by robot minutes, by form of learning", f"In {first}."),
        ],
    )


def _medians(size: Size, found: Mapping[str, Sequence[Marks]]) -> Iterator[Claim]:
    runs, groups = _grouped(found)
    n = f"{len(runs)} runs: {len(size.scenarios)} scenarios x {len(size.seeds)} seeds"
    for part, reach in _REACH.items():
        for mark_s, column in zip(size.marks_s, values(runs, "new", part).T, strict=True):
            if not np.isnan(column).all():
                what = f"mean AUC at {reach} after {time(mark_s)}"
                yield Claim.median(what, column, n, _BARS.get((part, int(mark_s))), groups=groups)


def _grouped(found: Mapping[str, Sequence[Marks]]) -> tuple[list[Marks], list[str]]:
    """All runs, and the scenario of each."""
    pairs = [(marks, name) for name, several in found.items() for marks in several]
    return [marks for marks, _ in pairs], [name for _, name in pairs]


def _untouched(size: Size, found: Mapping[str, Sequence[Marks]]) -> Iterator[Claim]:
    """The end in those scenarios alone that no choice of the learner was made in, by `llrp experiment ablate`."""
    runs, groups = _grouped({name: of for name, of in found.items() if name not in ablate.FULL.scenarios})
    if runs:
        what = f"mean AUC at 0 to 25 cm after {time(size.marks_s[-1])}, scenarios that `ablate` does not use"
        yield Claim.median(what, values(runs, "new")[:, -1], "{} runs", groups=groups)


def _worst(runs: Mapping[str, Sequence[Marks]]) -> Iterator[Claim]:
    """The scenario whose median at the last mark is least."""
    last = {name: values(found, "new")[:, -1] for name, found in runs.items()}
    known = {name: column for name, column in last.items() if not np.isnan(column).any()}
    if known:
        name = min(known, key=lambda name: median(known[name])[0])
        yield Claim.median(f"the worst scenario at the end: {name}", known[name], "{} seeds", _WORST_BAR)


def _by_form(compared: Mapping[str, Sequence[Marks]]) -> Iterator[Claim]:
    """Each other form less the usual one, paired by scenario and seed, at the last mark."""
    usual = values(compared[_USUAL], "new")[:, -1]
    for form, runs in compared.items():
        gain = values(runs, "new")[:, -1] - usual
        if form != _USUAL and not np.isnan(gain).all():
            yield Claim.median(f"{form}: gain at the end over the usual form", gain, "{} pairs")
