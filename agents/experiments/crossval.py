"""The paper's experiment: train offline on some scenarios, test on others; and leave one scenario out."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.commands.evaluate import ROUNDS, exam_of
from agents.commands.train import STEPS, remember, trained
from agents.experiments.drives import Drive
from agents.experiments.findings import Claim, Findings, Plot
from agents.experiments.settings import configuration_of, robot_of, scenario, scenarios, values_of, with_seed
from agents.experiments.trial import Result, Trial
from llrp_online import figures
from llrp_online.configuration import RobotConfiguration
from llrp_online.metrics import Score
from llrp_online.scoring import mean_auc
from replay import compiling

_OURS, _PAPER, _ONE_OUT = "our recipe, two scenarios out", "the paper's recipe, two out", "our recipe, one out"
#: AUC to reach, mean over 0 to 25 cm and at 4 to 8 cm by the sensor in the middle.
_FAR_BAR, _BEST_BAR = 0.90, 0.96
_FAR_M, _BEST_M = 0.25, (0.04, 0.08)
_CENTRE = "center"


@dataclass(frozen=True)
class Size:
    """How much is run: one drive a scenario."""

    scenarios: Sequence[str]
    seeds: Sequence[int]
    minutes: float
    steps: int
    one_out: bool


FULL = Size(scenarios(), (0,), 10.0, STEPS, True)
QUICK = Size(scenarios()[:3], (0,), 0.5, 60, False)


def trials(size: Size) -> list[Trial]:
    """All of them."""
    return [trial for _, trial in _named(size)]


def _named(size: Size) -> Iterator[tuple[str, Trial]]:
    """Form and trial."""
    usual = configuration_of("thymio")
    training = usual.training.model_copy(update={"loss": "paper", "learning_rate": 2e-4, "positive_weight_max": 1.0})
    network = usual.network.model_copy(update={"preset": "paper"})
    paper = usual.model_copy(update={"training": training, "network": network})
    pairs = [size.scenarios[i : i + 2] for i in range(0, len(size.scenarios), 2)]
    for seed in size.seeds:
        for out in pairs:
            yield _OURS, _trial(size, usual, out, seed)
            yield _PAPER, _trial(size, paper, out, seed)
        for name in size.scenarios if size.one_out else ():
            yield _ONE_OUT, _trial(size, usual, [name], seed)


def _trial(size: Size, form: RobotConfiguration, out: Sequence[str], seed: int) -> Trial:
    robot = robot_of(configuration_of("thymio"))
    drives = {name: Drive(robot, scenario(name), seed, size.minutes).as_json() for name in size.scenarios}
    return Trial(
        "agents.experiments.crossval:train",
        {
            "configuration": values_of(with_seed(form, seed)),
            "learned": [drive for name, drive in drives.items() if name not in out],
            "tested": {name: drives[name] for name in out},
            "steps": size.steps,
        },
    )


def train(
    folder: Path,
    configuration: Mapping[str, Any],
    learned: Sequence[Mapping[str, Any]],
    tested: Mapping[str, Mapping[str, Any]],
    steps: int,
) -> Result:
    """Train offline on drives; the score on each drive left out, with intervals: name -> score."""
    form = RobotConfiguration.model_validate(configuration)
    compiling.use(form.compute.compiled)
    trainer, _ = trained(form, remember(form, [Drive.of(drive).recorded(folder) for drive in learned]), steps)
    weights = trainer.weights()
    return {
        name: exam_of(form, [Drive.of(drive).recorded(folder)]).score(weights, rounds=ROUNDS).as_json()
        for name, drive in tested.items()
    }


def findings(size: Size, results: Sequence[Result]) -> Findings:
    """Mean over the scenarios left out, by form."""
    found: dict[str, dict[str, list[Score]]] = {}
    for (form, _), result in zip(_named(size), results, strict=True):
        for name, score in result.items():
            found.setdefault(form, {}).setdefault(name, []).append(Score.of_json(score))
    story = (
        f"{len(size.scenarios)} scenarios, {size.minutes:g} robot minutes each under the acquisition controller. Two "
        f"are left out at a time (or one), the network learns offline from the others in {size.steps:,} steps of "
        f"batches of 64, and predicts those left out. Cells with fewer than ten known labels of a class do not count. "
        "Values are medians over the scenarios left out, intervals resample scenarios."
    )
    whole = mean_score([score for scores in found[_OURS].values() for score in scores])
    return Findings(
        "crossval: the paper's experiment",
        story,
        list(_claims(found)),
        {form: {name: [s.as_json() for s in scores] for name, scores in by.items()} for form, by in found.items()},
        [
            Plot("auc_map", figures.auc_map(whole), "AUC of each target and sensor, mean over the scenarios left out"),
            Plot("auc_by_distance", figures.auc_by_distance(whole), "AUC by distance, with intervals"),
            Plot(
                "known_labels",
                figures.known_labels(np.stack([whole.n_neg.sum(1), whole.n_pos.sum(1)], -1), whole.targets),
                "Known labels by distance, negative and positive",
            ),
        ],
    )


def _claims(found: Mapping[str, Mapping[str, Sequence[Score]]]) -> Iterator[Claim]:
    for form, by in found.items():
        scores = [score for scores in by.values() for score in scores]
        asked = form == _OURS
        n = f"{len(by)} scenarios left out"
        yield Claim.median(f"{form}: mean AUC at 0 to 25 cm", [_far(s) for s in scores], n, _FAR_BAR if asked else None)
        best = [_at(score, *_BEST_M) for score in scores]
        yield Claim.median(f"{form}: AUC at 4 to 8 cm, centre", best, n, _BEST_BAR if asked else None)
    for name, scores in found[_OURS].items():
        far = mean_auc(scores[0], _FAR_M)
        yield Claim(
            f"{name} left out: mean AUC at 0 to 25 cm", far[0] if far[1] else None, None, None, f"{far[1]} cells"
        )


def _far(score: Score) -> float:
    return mean_auc(score, _FAR_M)[0]


def _at(score: Score, nearest_m: float, farthest_m: float) -> float:
    """Mean AUC of the sensor in the middle between two distances; NaN where none is defined."""
    distance_m = np.hypot(score.targets[:, 0], score.targets[:, 1])
    rows = (distance_m >= nearest_m - 1e-9) & (distance_m <= farthest_m + 1e-9)
    cells = score.auc[rows, score.sensors.index(_CENTRE)]
    return float(np.nanmean(cells)) if not np.isnan(cells).all() else float("nan")


def mean_score(scores: Sequence[Score]) -> Score:
    """Cell by cell: AUC and intervals averaged over the scores that have one, labels counted together."""

    def mean(values: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
        stacked = np.stack(values)
        known = ~np.isnan(stacked)
        total = np.where(known, stacked, 0.0).sum(0)
        return np.divide(total, known.sum(0), out=np.full(total.shape, np.nan), where=known.any(0))

    first = scores[0]
    return Score(
        first.targets,
        first.sensors,
        mean([score.auc for score in scores]),
        mean([score.low for score in scores]),
        mean([score.high for score in scores]),
        sum((score.n_pos for score in scores), np.zeros_like(first.n_pos)),
        sum((score.n_neg for score in scores), np.zeros_like(first.n_neg)),
        float(np.nanmean([score.pooled_auc for score in scores])),
    )
