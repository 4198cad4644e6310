"""Each choice of the learner alone: what another would gain or lose, paired by scenario and seed."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from agents.experiments.bars import difference_bars
from agents.experiments.curves import Marks, time, values
from agents.experiments.drives import Drive
from agents.experiments.findings import Claim, Findings, Plot
from agents.experiments.learning import learning
from agents.experiments.settings import HELD_OUT, changed, configuration_of, robot_of, scenario, with_seed
from agents.experiments.trial import Result, Trial

_USUAL, _PRETRAINED = "as configured", "pretrained to tell pictures again"
#: Name -> what differs from the defaults: as `changed` takes it, or an argument of `learning`.
FORMS: Mapping[str, Mapping[str, Any]] = {
    _USUAL: {},
    "the paper's loss": {"training.loss": "paper"},
    "the paper's network": {"network.preset": "paper"},
    "first in, first out": {"memory.policy": "fifo"},
    "reservoir": {"memory.policy": "reservoir"},
    "near-duplicates kept": {"memory.duplicate_distance": 0.0},
    "recent share 0": {"memory.recent_share": 0.0},
    "recent share 1": {"memory.recent_share": 1.0},
    "no floor of positives": {"memory.positives_floor": 0.0},
    "positives not weighted": {"training.positive_weight_max": 1.0},
    "labels by drift": {"labels.window": "drift"},
    "no flips": {"augmentation.flip": 0.0},
    "no noise": {"augmentation.noise": 0.0},
    "no grey": {"augmentation.grey": 0.0},
    "no shadows": {"augmentation.shadow": 0.0},
    "other colours": {"augmentation.colour": 0.5},
    "no augmentation": {
        "augmentation.flip": 0.0,
        "augmentation.noise": 0.0,
        "augmentation.grey": 0.0,
        "augmentation.shadow": 0.0,
    },
    "weights not averaged": {"training.average": 0.0},
    "learning rate 3e-4": {"training.learning_rate": 3e-4},
    "learning rate 3e-3": {"training.learning_rate": 3e-3},
    "batch 32, twice the steps": {"training.batch": 32, "training.steps_per_second": 10.0},
    "the mirror image not looked at": {"network.mirrored": False},
    "dropout 0.2": {"variant": {"name": "dropout", "share": 0.2}},
    "dropout 0.5": {"variant": {"name": "dropout", "share": 0.5}},
    "dropout 0.8": {"variant": {"name": "dropout", "share": 0.8}},
    "what the gate lets out": {"published": True},
    "squared error of the known labels": {"variant": {"name": "squared error"}},
    "frames of one line must agree": {"variant": {"name": "consistency", "share": 1.0}},
    "frames of one line must agree, weighed a third": {"variant": {"name": "consistency", "share": 0.3}},
    "free space between silent poses": {"variant": {"name": "free space", "reach_m": 0.1}},
    _PRETRAINED: {"variant": {"name": "pretrained"}},
}
#: Where a network is pretrained: scenarios that none of the forms is tried in.
_ELSEWHERE = ("cardboard", "checker", "stone")
PRETRAINING_STEPS = 1000


@dataclass(frozen=True)
class Size:
    """How much is run. A memory that is never full has nothing to choose, so it gets a tight budget in every form."""

    scenarios: Sequence[str]
    seeds: Sequence[int]
    marks_s: Sequence[float]
    held_out_minutes: float
    budget_mb: float
    forms: Sequence[str]


FULL = Size(("grass", "tiles", "wood"), (0, 1, 2), (60, 180, 300), 2.5, 24.0, tuple(FORMS))
QUICK = Size(("tiles",), (0,), (30,), 1.0, 24.0, tuple(FORMS)[:3])


def trials(size: Size) -> list[Trial]:
    """All of them."""
    return [trial for _, trial in _named(size)]


def _named(size: Size) -> Iterator[tuple[str, Trial]]:
    """Form and trial."""
    usual = configuration_of("thymio")
    robot = robot_of(usual)
    for form in size.forms:
        told = dict(FORMS[form])
        variant, published = told.pop("variant", None), told.pop("published", False)
        learner = changed(usual, {"memory.budget_mb": size.budget_mb, **told})
        if form == _PRETRAINED:
            elsewhere = [Drive(robot, scenario(name), 0, size.held_out_minutes).as_json() for name in _ELSEWHERE]
            variant = {**variant, "drives": elsewhere, "steps": PRETRAINING_STEPS}
        for name in size.scenarios:
            held_out = [Drive(robot, scenario(name), HELD_OUT + i, size.held_out_minutes) for i in (0, 1)]
            for seed in size.seeds:
                lived = [Drive(robot, scenario(name), seed, size.marks_s[-1] / 60, "seek")]
                lesson = (with_seed(learner, seed), lived, {"new": held_out}, size.marks_s)
                yield form, learning(*lesson, variant=variant, published=published)


def findings(size: Size, results: Sequence[Result]) -> Findings:
    """The gain of each form over the configured one, at each mark."""
    runs: dict[str, list[Marks]] = {}
    for (form, _), result in zip(_named(size), results, strict=True):
        runs.setdefault(form, []).append(result["marks"])
    story = (
        "The learner of `llrp experiment scratch` with one choice changed, over the same drives "
        f"({', '.join(size.scenarios)}; {len(size.seeds)} seeds each) and a memory of {size.budget_mb:g} MB, so that "
        "it fills. Each value is the median of the differences in mean AUC at 0 to 25 cm, paired by scenario and seed; "
        "the interval resamples pairs. An interval above zero: the change is better than what is configured."
    )
    claims = [claim for form in size.forms if form != _USUAL for claim in _gains(size, runs, form)]
    last = [claim for claim in claims if claim.what.endswith(time(size.marks_s[-1]))]
    drawn = difference_bars({c.what: (c.value, c.interval) for c in last}, "gain in mean AUC at the last mark")
    return Findings("ablate: one choice at a time", story, claims, runs, [Plot("gains", drawn, "Gain of each change")])


def _gains(size: Size, runs: Mapping[str, Sequence[Marks]], form: str) -> Iterator[Claim]:
    gains = values(runs[form], "new") - values(runs[_USUAL], "new")
    for mark_s, column in zip(size.marks_s, gains.T, strict=True):
        if not np.isnan(column).all():
            yield Claim.median(f"{form}, after {time(mark_s)}", column, "{} pairs")
