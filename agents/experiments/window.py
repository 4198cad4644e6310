"""The label rule's window: what each fixed one and `drift` give, as odometry and behaviour change."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from agents.experiments.curves import values
from agents.experiments.drives import Drive
from agents.experiments.findings import Claim, Findings, Plot
from agents.experiments.labelling import BLIND_DRIFT, labelling
from agents.experiments.learning import learning
from agents.experiments.settings import HELD_OUT, changed, configuration_of, robot_of, scenario, with_seed
from agents.experiments.trial import Result, Trial
from agents.experiments.window_figures import auc_by_window
from agents.experiments.window_runs import DRIFTING, Runs
from agents.robots.simulated.body import SLIP_LENGTH_M
from agents.window_answer import learner_of
from llrp_online import figures
from llrp_online.configuration import RobotConfiguration
from llrp_online.configuration.running import Simulation
from llrp_online.figures import WindowPanel
from llrp_online.windows import DRIFT, UNLIMITED, rules

#: Name -> what the wheels do; `ordinary` is what `configs/thymio.toml` has.
QUALITIES: Mapping[str, Mapping[str, float]] = {
    "good": {"simulation.slip": 0.01, "simulation.bias": 0.001},
    "ordinary": {},
    "bad": {"simulation.slip": 0.06, "simulation.bias": 0.015},
}
BEHAVIOURS = {"explore": "acquisition", "walk": "free roaming"}
#: Windows that a learner is trained with: those that labels are told for.
_LEARNED = (*rules(configuration_of("thymio").labels.rule()), BLIND_DRIFT)
_RUNS = "{} runs, a scenario and a seed each"
#: Behaviour and quality.
Cell = tuple[str, str]


@dataclass(frozen=True)
class Size:
    """How much is run: run `i` has seed `i` in scenario `i`."""

    scenarios: Sequence[str]
    minutes: float
    qualities: Sequence[str]
    learned: Sequence[str]
    held_out_minutes: float

    @property
    def seeds(self) -> list[int]:
        """One a scenario."""
        return list(range(len(self.scenarios)))

    @property
    def cells(self) -> list[Cell]:
        """Every behaviour with every quality."""
        return [(behaviour, quality) for behaviour in BEHAVIOURS for quality in self.qualities]


FULL = Size(("cardboard", "checker", "grass", "tiles", "wood"), 5.0, tuple(QUALITIES), _LEARNED, 2.5)
QUICK = Size(("tiles",), 0.5, ("bad",), ("2 s", DRIFT), 0.5)


def trials(size: Size) -> list[Trial]:
    """All of them."""
    return [trial for _, _, trial in _named(size)]


def _named(size: Size) -> Iterator[tuple[Cell, str | None, Trial]]:
    """Cell; window that a learner learns with, or None of a trial that only labels; trial."""
    usual, exact = configuration_of("thymio"), changed(configuration_of("thymio"), QUALITIES["good"])
    for behaviour, quality in size.cells:
        robot = changed(usual, QUALITIES[quality])
        for seed, name in enumerate(size.scenarios):
            drive = Drive(robot_of(robot), scenario(name), seed, size.minutes, behaviour)
            yield (behaviour, quality), None, labelling(drive)
            exam = [
                Drive(robot_of(exact), scenario(name), HELD_OUT + layout, size.held_out_minutes) for layout in (0, 1)
            ]
            for window in size.learned:
                form = with_seed(_learner(robot, window), seed)
                yield (
                    (behaviour, quality),
                    window,
                    learning(form, [drive], {"new": exam}, (60 * size.minutes,), examiner=exact),
                )


def _learner(robot: RobotConfiguration, window: str) -> RobotConfiguration:
    """The configuration of a learner of the window of that name."""
    if window == BLIND_DRIFT:
        return learner_of(changed(robot, {"odometry.trust_covariance": False}), DRIFT)
    return learner_of(robot, window)


def findings(size: Size, results: Sequence[Result]) -> Findings:
    """Curves, recommended windows, and what `drift` gains or loses beside the best fixed one."""
    found: dict[Cell, Runs] = {cell: Runs([], {}) for cell in size.cells}
    for (cell, window, _), result in zip(_named(size), results, strict=True):
        if window is None:
            found[cell].labelled.append(result)
        else:
            auc = float(values([result["marks"]], "new")[0, -1])
            found[cell].auc.setdefault(window, []).append(auc)
    panels = [_panel(cell, of) for cell, of in found.items()]
    scores = {_title(cell): {name: of.auc[name] for name in size.learned} for cell, of in found.items()}
    numbers = {_title(cell): {"labelled": of.labelled, "auc": _plain(of.auc)} for cell, of in found.items()}
    return Findings(
        "window: how long to trust odometry",
        _story(size),
        [*_pooled(list(found.values())), *(claim for cell, of in found.items() for claim in _claims(cell, of))],
        numbers,
        [
            Plot(
                "yield_and_contradiction",
                figures.windows(panels, "labels that the truth contradicts"),
                "Known labels a frame, and the share of them that true poses contradict, by window",
                "Medians over runs. Grey: the recommended fixed window. Open marks and dotted lines: drift.",
            ),
            Plot(
                "auc_by_window",
                auc_by_window(scores, {_title(cell): of.best for cell, of in found.items()}),
                "AUC of a learner trained on each window's labels, with intervals",
                "Medians over runs, bars are 95 % intervals. Grey: what true labels recommend, where a learner had it.",
            ),
        ],
        [*(_remark(cell, of) for cell, of in found.items()), _KNOWING],
    )


_KNOWING = (
    "The configuration is the same at every quality. Two forms of drift are compared: one reads the noise of each step "
    "from the covariance that the odometry message brings, which grows with the wheels' slip and knows nothing of "
    "their bias; the other has no covariance and takes the default noise of [odometry] whatever the wheels do."
)


def _title(cell: Cell) -> str:
    return f"{BEHAVIOURS[cell[0]]}, {cell[1]} odometry"


def _panel(cell: Cell, of: Runs) -> WindowPanel:
    per_frame = [of.middle(name, "known") or 0.0 for name in of.fixed]
    drift = of.middle(DRIFT, "known") or 0.0, of.middle(DRIFT, "contradicted")
    shares = [of.middle(name, "contradicted") for name in of.fixed]
    return WindowPanel(_title(cell), of.fixed, per_frame, shares, drift, of.fixed.index(of.best))


def _pooled(found: Sequence[Runs]) -> Iterator[Claim]:
    """`drift` beside the best fixed window of each odometry and behaviour, all together."""
    for name in DRIFTING:
        for hindsight, which in (
            (True, "the best fixed window"),
            (False, "the fixed window that the other runs choose"),
        ):
            # A run's scenario and seed are the same at every odometry and behaviour: drawn together.
            told = [pair for of in found for pair in enumerate(of.gains(name, hindsight=hindsight))]
            gains = [gain for _, gain in told]
            if not np.isnan(gains).all():
                what = f"all together: AUC with {name} less that with {which} of each odometry and behaviour"
                yield Claim.median(what, gains, _RUNS, groups=[run for run, _ in told])


def _claims(cell: Cell, of: Runs) -> Iterator[Claim]:
    """`drift` beside the best fixed window, then what the labels are."""
    if (best := of.best_learned()) is not None:
        what = f"{_title(cell)}: mean AUC at 0 to 25 cm with the best fixed window, {best}"
        yield Claim.median(what, of.auc[best], _RUNS)
        for name in DRIFTING:
            if name in of.auc:
                bar = 0.0 if name == DRIFT else None
                gains = of.gains(name, hindsight=True)
                yield Claim.median(f"{_title(cell)}: AUC with {name} less that with {best}", gains, _RUNS, bar)
    for name in dict.fromkeys((of.best, UNLIMITED, *DRIFTING)):
        shares = [run["windows"][name]["contradicted"] for run in of.labelled]
        also = ", the recommended window" if name == of.best else ""
        yield Claim.median(f"{_title(cell)}: share of labels contradicted, {name}{also}", shares, _RUNS)


def _remark(cell: Cell, of: Runs) -> str:
    told = ", ".join(run["recommended"] or "nothing" for run in of.labelled)
    split = ", ".join(
        f"{name} {_percent(of.middle(name, 'positives'))} and {_percent(of.middle(name, 'negatives'))}"
        for name in dict.fromkeys((of.best, UNLIMITED, DRIFT))
    )
    return (
        f"{_title(cell)}: {of.best} is recommended by the truth; run by run, `llrp window` would say {told}. "
        f"Of positive and of negative labels contradicted: {split}."
    )


def _percent(share: float | None) -> str:
    return "none known" if share is None else f"{100 * share:.1f} %"


def _story(size: Size) -> str:
    usual = configuration_of("thymio")
    qualities = "; ".join(
        f"{name}: {noise_per_metre(changed(usual, QUALITIES[name]).simulated())}" for name in size.qualities
    )
    return (
        f"{len(size.scenarios)} runs of {size.minutes:g} robot minutes, each its own scenario "
        f"({', '.join(size.scenarios)}) and seed, by behaviour ({', '.join(BEHAVIOURS.values())}) and by quality of "
        f"the odometry ({qualities}). A label is contradicted if the sensors, put without noise where the robot truly "
        "would have stood at the target, would have said otherwise, or if no robot can stand there. A window is "
        "recommended if its labels are worth most: their number times their squared correlation with the truth; the "
        f"shortest within 1 % of the best. Learners live one drive ({', '.join(size.learned)}) and are tried on two "
        "other layouts of the scenario, driven with good odometry and labelled by the usual rule, the same for all. "
        "Values are medians over runs, intervals resample runs; differences are paired by run, and the best fixed "
        "window is the one with the highest mean, chosen with hindsight, which drift has not."
    )


def noise_per_metre(simulation: Simulation) -> str:
    """How far odometry strays over one metre straight on, in words: see `agents.robots.simulated.body`.

    >>> noise_per_metre(Simulation(slip=0.02, bias=0.005))
    'after 1 m straight on heading off by 1.7 deg (slip) and 4.3 deg (bias), position along the way by 1.4 and 3.5 mm'
    """
    wheel_m = simulation.slip * math.sqrt(SLIP_LENGTH_M), simulation.bias  # each wheel's deviation after one metre
    turn = [math.degrees(math.sqrt(2) * one / simulation.track_m) for one in wheel_m]
    along = [1000 * one / math.sqrt(2) for one in wheel_m]
    return (
        f"after 1 m straight on heading off by {turn[0]:.1f} deg (slip) and {turn[1]:.1f} deg (bias), "
        f"position along the way by {along[0]:.1f} and {along[1]:.1f} mm"
    )


def _plain(auc: Mapping[str, Sequence[float]]) -> dict[str, list[float | None]]:
    return {name: [None if math.isnan(value) else value for value in found] for name, found in auc.items()}
