"""From nothing: how soon the online learner sees, in each scenario, by controller and by steps a second."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from agents.experiments.drives import Drive
from agents.experiments.findings import Claim, Findings, Plot
from agents.experiments.learning import learning
from agents.experiments.settings import configuration_of, scenario, scenarios
from agents.experiments.statistics import median
from agents.experiments.trial import Result, Trial
from llrp_online.configuration import RobotConfiguration
from llrp_online.figures.style import LINES, TEXT_PT, dress, new_figure

#: Seeds of held-out layouts lie this far from those that were lived in.
_HELD_OUT = 1000
_USUAL = "explore, as configured"


@dataclass(frozen=True)
class Size:
    """How much is run."""

    scenarios: Sequence[str]
    seeds: Sequence[int]
    marks_s: Sequence[float]
    held_out_minutes: float
    rates: Sequence[float]


FULL = Size(scenarios(), (0, 1, 2), (15, 30, 60, 120, 180, 300, 600), 5.0, (2.0, 10.0, 20.0))
QUICK = Size(("tiles",), (0,), (15, 30), 1.0, (10.0,))


def trials(size: Size) -> list[Trial]:
    """All of them: the usual form in every scenario; the others in the first three."""
    return [trial for _, _, trial in _named(size)]


def _named(size: Size) -> Iterator[tuple[str, str, Trial]]:
    usual = configuration_of("thymio")
    for name in size.scenarios:
        for seed in size.seeds:
            yield _USUAL, name, _trial(size, usual, name, seed, "explore")
    for name in size.scenarios[:3]:
        for seed in size.seeds:
            yield "random walk", name, _trial(size, usual, name, seed, "walk")
            for rate in size.rates:
                training = usual.training.model_copy(update={"steps_per_second": rate})
                form = usual.model_copy(update={"training": training})
                yield f"explore, {rate:g} steps a second", name, _trial(size, form, name, seed, "explore")


def _trial(size: Size, usual: RobotConfiguration, name: str, seed: int, behaviour: str) -> Trial:
    form = usual.model_copy(update={"training": usual.training.model_copy(update={"seed": seed})})
    robot, arena = usual.model_dump(mode="json"), scenario(name)
    lived = Drive(robot, arena, seed, size.marks_s[-1] / 60, behaviour)
    held_out = [Drive(robot, arena, _HELD_OUT + layout, size.held_out_minutes) for layout in (0, 1)]
    return learning(form, [lived], held_out, size.marks_s)


def findings(size: Size, results: Sequence[Result]) -> Findings:
    """Medians over runs at each mark, beside the bars."""
    runs = [(form, name, result["marks"]) for (form, name, _), result in zip(_named(size), results, strict=True)]
    usual = [(name, marks) for form, name, marks in runs if form == _USUAL]
    claims = [
        claim
        for part, bars in (("far", {180: 0.80, 300: 0.87, 600: 0.92}), ("near", {600: 0.95}))
        for claim in _medians(size, [marks for _, marks in usual], part, bars)
    ]
    worst = _worst(usual)
    if worst is not None:
        claims.append(worst)
    forms = list(dict.fromkeys(form for form, _, _ in runs))
    numbers = {
        form: {name: [m for f, n, m in runs if (f, n) == (form, name)] for name in dict.fromkeys(size.scenarios)}
        for form in forms
    }
    story = (
        f"The learner starts with random weights in each of {len(size.scenarios)} scenarios, {len(size.seeds)} seeds "
        f"each (layout, noise, weights); its weights are tried as they are at each mark on two other layouts of the "
        f"same scenario, {size.held_out_minutes:g} minutes each. Mean AUC is over the cells (target x sensor) with at "
        "least ten known labels of each class; figures are medians over runs."
    )
    first_three = set(size.scenarios[:3])
    compared = {form: [m for f, n, m in runs if f == form and n in first_three] for form in forms}
    plots = [
        Plot("learning_curves", _curves({"all scenarios": [m for _, m in usual]}), "Median AUC by robot minutes"),
        Plot(
            "forms_compared",
            _curves(compared),
            "Median AUC by robot minutes, by controller and steps a second",
            f"In {', '.join(size.scenarios[:3])}.",
        ),
    ]
    return Findings("scratch: from nothing", story, claims, numbers, plots)


def _medians(size: Size, runs: list[list[Result]], part: str, bars: dict[int, float]) -> Iterator[Claim]:
    reach = {"far": "0 to 25 cm", "near": "0 to 15 cm"}[part]
    for number, mark_s in enumerate(size.marks_s):
        values = [marks[number][part] for marks in runs if marks[number][part] is not None]
        if values:
            middle, interval = median(values)
            what = f"mean AUC at {reach} after {_time(mark_s)}"
            n = f"{len(values)} runs: {len(size.scenarios)} scenarios x {len(size.seeds)} seeds"
            yield Claim(what, middle, bars.get(int(mark_s)), interval, n)


def _worst(usual: list[tuple[str, list[Result]]]) -> Claim | None:
    """The scenario whose median at the last mark is least."""
    last: dict[str, list[float]] = {}
    for name, marks in usual:
        if marks[-1]["far"] is not None:
            last.setdefault(name, []).append(marks[-1]["far"])
    if not last:
        return None
    name = min(last, key=lambda n: median(last[n])[0])
    middle, interval = median(last[name])
    what = f"the worst scenario ({name}), mean AUC at 0 to 25 cm after {_time(usual[0][1][-1]['lived_s'])}"
    return Claim(what, middle, 0.87, interval, f"{len(last[name])} seeds")


def _time(seconds: float) -> str:
    return f"{seconds:g} s" if seconds < 60 else f"{seconds / 60:g} min"


def _curves(groups: dict[str, list[list[Result]]]) -> Figure:
    figure = new_figure(4.6, 3.1)
    axes = figure.add_subplot()
    for number, (name, runs) in enumerate(groups.items()):
        colour, marker, dash = LINES[number % len(LINES)]
        minutes = np.array([mark["lived_s"] / 60 for mark in runs[0]])
        values = np.array([[np.nan if m["far"] is None else m["far"] for m in marks] for marks in runs])
        known = ~np.isnan(values).all(0)
        middle, low, high = (np.nanpercentile(values[:, known], q, axis=0) for q in (50, 25, 75))
        axes.fill_between(minutes[known], low, high, color=colour, alpha=0.15, linewidth=0)
        axes.plot(minutes[known], middle, color=colour, marker=marker, linestyle=dash, markersize=4, label=name)
    dress(axes, "robot time [min]", "mean AUC, 0 to 25 cm")
    axes.legend(
        fontsize=TEXT_PT, frameon=False, title="median; the band holds half of the runs", title_fontsize=TEXT_PT
    )
    return figure
