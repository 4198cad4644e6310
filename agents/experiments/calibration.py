"""Do the probabilities mean what they say: by distance, before and after scaling on prequential pairs, as it roams."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from agents.commands.evaluate import exam_of
from agents.experiments.drives import Drive
from agents.experiments.findings import Claim, Findings, Plot
from agents.experiments.settings import HELD_OUT, configuration_of, plain, robot_of, scenario, with_seed
from agents.experiments.trial import Result, Trial
from agents.replayed import Marks, learn_over
from llrp_online.calibration import Calibration
from llrp_online.configuration import RobotConfiguration
from llrp_online.figures.style import CHANCE, LINES, TEXT_PT, dress, new_figure
from llrp_online.learner import Learner
from llrp_online.reliability import reliability
from replay import compiling

_BEFORE, _SCALE, _BOTH = "as it comes", "scaled (temperature)", "scaled and shifted"
_STREAM, _HELD_OUT = "the frames it meets next", "other layouts"
_BAR = 0.03

Predictions = NDArray[np.floating]


@dataclass(frozen=True)
class Size:
    """How much is run."""

    scenarios: Sequence[str]
    seeds: Sequence[int]
    minutes: float
    refit_s: float
    newest: int
    skipped_s: float
    held_out_minutes: float


FULL = Size(("grass", "tiles", "wood"), (0, 1, 2), 10.0, 10.0, 1200, 120.0, 5.0)
QUICK = Size(("tiles",), (0,), 1.0, 10.0, 1200, 20.0, 0.5)


def trials(size: Size) -> list[Trial]:
    """All of them."""
    usual = configuration_of("thymio")
    robot = robot_of(usual)
    return [
        Trial(
            "agents.experiments.calibration:calibrate",
            {
                "configuration": plain(with_seed(usual, seed)),
                "lived": Drive(robot, scenario(name), seed, size.minutes, "seek").as_json(),
                "held_out": Drive(robot, scenario(name), HELD_OUT, size.held_out_minutes).as_json(),
                "refit_s": size.refit_s,
                "newest": size.newest,
                "skipped_s": size.skipped_s,
            },
        )
        for name in size.scenarios
        for seed in size.seeds
    ]


def calibrate(
    folder: Path,
    configuration: Mapping[str, Any],
    lived: Mapping[str, Any],
    held_out: Mapping[str, Any],
    refit_s: float,
    newest: int,
    skipped_s: float,
) -> Result:
    """Live through a drive; every `refit_s` fit the newest pairs, and calibrate what is predicted until the next fit.

    Args:
        folder: of what trials share.
        configuration: the learner's, as JSON values.
        lived: the drive it learns from.
        held_out: a drive in another layout, predicted at the end.
        refit_s: robot seconds between fits.
        newest: frames that a fit is of.
        skipped_s: predictions before this are not judged.

    Returns:
        `bands`: [smallest, largest] distance [m] of each; then where -> form -> one object a band with `ece`, `brier`,
        `predicted`, `observed`, `count`.
    """
    form = RobotConfiguration.model_validate(configuration)
    compiling.use(form.compute.compiled)
    learner = Learner(form)
    bands = learner.prequential.band_of_target
    fits = {_SCALE: list[Calibration](), _BOTH: list[Calibration]()}
    starts: list[int] = []

    def refit(_: float) -> None:
        pairs = learner.prequential.pairs(newest)
        for name, calibrations in fits.items():
            calibrations.append(Calibration.fit(*pairs, bands, offset=name == _BOTH))
        starts.append(len(learner.prequential))

    marks_s = (refit_s * (1 + i) for i in range(round(float(lived["minutes"]) * 60 / refit_s)))
    learn_over(learner, [Drive.of(lived).recorded(folder)], Marks(learner, marks_s, refit))
    raw, labels = learner.prequential.pairs()
    judged = slice(starts[round(skipped_s / refit_s) - 1], None)
    exam = exam_of(form, [Drive.of(held_out).recorded(folder)])
    other = exam.predict(learner.trainer.weights())

    def told(probabilities: Predictions, truth: NDArray[np.int8]) -> list[Result]:
        return [_plain(probabilities[:, bands == band], truth[:, bands == band]) for band in np.unique(bands)]

    stream = {_BEFORE: told(raw[judged], labels[judged])}
    elsewhere = {_BEFORE: told(other, exam.labels)}
    for name, calibrations in fits.items():
        stream[name] = told(_as_it_went(raw, starts, calibrations)[judged], labels[judged])
        elsewhere[name] = told(calibrations[-1].apply(other), exam.labels)
    edges = [list(edge) for edge in learner.prequential.band_edges_m]
    return {"bands": edges, _STREAM: stream, _HELD_OUT: elsewhere}


def _as_it_went(raw: Predictions, starts: Sequence[int], fits: Sequence[Calibration]) -> Predictions:
    """(N, T, S): each prediction by the newest fit there was when it was made."""
    found = raw.astype(np.float64)
    for start, stop, fit in zip(starts, [*starts[1:], len(raw)], fits, strict=True):
        found[start:stop] = fit.apply(raw[start:stop])
    return found


def _plain(probabilities: Predictions, labels: NDArray[np.int8]) -> Result:
    found = reliability(probabilities, labels)
    numbers = {
        name: value if np.isfinite(value) else None for name, value in (("ece", found.ece), ("brier", found.brier))
    }
    curves = {
        name: [None if np.isnan(v) else float(v) for v in getattr(found, name)] for name in ("predicted", "observed")
    }
    return {**numbers, **curves, "count": found.labels.tolist()}


def findings(size: Size, results: Sequence[Result]) -> Findings:
    """Calibration error by band, before and after, where it roams and in other layouts."""
    story = (
        f"The learner of `llrp experiment scratch` lives {size.minutes:g} minutes ({', '.join(size.scenarios)}; "
        f"{len(size.seeds)} seeds each). Every {size.refit_s:g} s the newest {size.newest:,} predictions whose labels "
        "have resolved fit two numbers for each band of distances, a scale (temperature) and an offset, which hold for "
        "what is predicted until the next fit: nothing is judged that a fit has seen. Expected calibration error (ECE) "
        f"over 15 bins, of predictions after {size.skipped_s:g} s on the stream, and at the end in another layout. "
        "Values are medians over runs, intervals resample runs."
    )
    plots = [
        Plot(
            f"reliability_{name}",
            _curves(results, where),
            f"Reliability curves by distance, before and after scaling: {where}",
            "On the diagonal a probability means what it says.",
        )
        for name, where in (("stream", _STREAM), ("other_layouts", _HELD_OUT))
    ]
    runs = {"runs": list(results)}
    remarks = list(_remarks(results))
    return Findings("calibration: what a probability means", story, list(_claims(results)), runs, plots, remarks)


def _remarks(results: Sequence[Result]) -> Iterator[str]:
    """What the numbers say of other layouts; of AUC nothing needs to be measured."""
    here, there = (np.median([_mean(run[where][_BOTH], "ece") for run in results]) for where in (_STREAM, _HELD_OUT))
    yield (
        f"Over all bands the error, scaled and shifted, is {here:.3f} on the stream and {there:.3f} in other layouts: "
        "the pairs that it is fitted to come from the arena that the learner knows."
    )
    yield "AUC is not touched: within a band the map is monotonic."


def _claims(results: Sequence[Result]) -> Iterator[Claim]:
    for where in (_STREAM, _HELD_OUT):
        for form in (_BEFORE, _SCALE, _BOTH):
            for band, edges in enumerate(results[0]["bands"]):
                bar = _BAR if form == _BOTH else None
                errors = [run[where][form][band]["ece"] for run in results]
                yield Claim.median(f"ECE, {_name(edges)}, {form}, {where}", errors, "{} runs", bar, at_most=True)
    for form in (_BEFORE, _SCALE, _BOTH):
        whole = [_mean(run[_STREAM][form], "brier") for run in results]
        yield Claim.median(f"Brier score, {form}, {_STREAM}", whole, "{} runs", at_most=True)


def _mean(bands: Sequence[Result], measure: str) -> float:
    """Over all labels of a run."""
    count = [sum(band["count"]) for band in bands]
    return float(np.average([band[measure] or 0.0 for band in bands], weights=count))


def _name(edges: Sequence[float]) -> str:
    return f"{100 * edges[0]:.0f} to {100 * edges[1]:.0f} cm"


def _curves(results: Sequence[Result], where: str) -> Figure:
    """One panel a band; each form's observed share against its predicted one, over all runs together."""
    bands = results[0]["bands"]
    figure = new_figure(2.0 * len(bands) + 0.6, 2.6)
    for band, edges in enumerate(bands):
        axes = figure.add_subplot(1, len(bands), band + 1)
        axes.plot((0, 1), (0, 1), color=CHANCE, linewidth=0.8)
        for number, form in enumerate((_BEFORE, _BOTH)):
            colour, marker, dash = LINES[number]
            predicted, observed = _pooled([run[where][form][band] for run in results])
            axes.plot(predicted, observed, color=colour, marker=marker, linestyle=dash, markersize=3, label=form)
        dress(axes, "predicted", "observed" if band == 0 else "")
        axes.set_title(_name(edges), fontsize=TEXT_PT)
        axes.set_aspect("equal")
    figure.axes[0].legend(fontsize=TEXT_PT - 1, frameon=False)
    return figure


def _pooled(curves: Sequence[Mapping[str, Any]]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean predicted and observed of each bin that holds labels, over all runs."""
    count = np.array([curve["count"] for curve in curves], np.float64)
    both = [
        (count * np.array([[v or 0.0 for v in curve[name]] for curve in curves])).sum(0)
        for name in ("predicted", "observed")
    ]
    there = count.sum(0) > 0
    predicted, observed = (values[there] / count.sum(0)[there] for values in both)
    return predicted, observed
