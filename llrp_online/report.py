"""The report of a run: one page that opens anywhere, without a network, and the same numbers as JSON."""

import html
import importlib.metadata
import json
import math
import platform
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from llrp_online import figures
from llrp_online.configuration import RobotConfiguration
from llrp_online.files import replace
from llrp_online.metrics import Score
from llrp_online.page import document, image, number, section, table

#: Robot minute, mean AUC up to 25 cm and up to 15 cm (None: undefined), and the targets x sensors the former is of.
CurvePoint = tuple[float, float | None, float | None, int]


@dataclass(frozen=True, eq=False)
class Example:
    """One frame to show.

    Attributes:
        picture: (H, W, 3 x cameras) uint8.
        labels: (T, S) int8: 1, 0, -1 unknown.
        probabilities: (T, S) float32, as predicted.
        caption: which frame this is.
    """

    picture: NDArray[np.uint8]
    labels: NDArray[np.int8]
    probabilities: NDArray[np.float32]
    caption: str


@dataclass(frozen=True, eq=False)
class Report:
    """What a run has to show. What is empty is left out of the page.

    Attributes:
        title: of the page.
        configuration: the robot's.
        seed: of the run.
        versions: of the programs, see `versions`.
        facts: name and value, as they are to be read.
        curve: the learning curve.
        scores: by name.
        examples: frames to show.
        path: (N, 3) float64 odometry `[x_m, y_m, yaw_rad]`; a row of NaN breaks the line.
        fired: (M, 2) float64 `[x_m, y_m]` of the robot where a sensor fired.
        known: (T, 2) int64, known negatives and positives of each target.
        path_s: (N,) float64, time of each pose; None: the path is coloured by the share of the run.
    """

    title: str
    configuration: RobotConfiguration
    seed: int
    versions: Mapping[str, str]
    facts: Sequence[tuple[str, str]]
    curve: Sequence[CurvePoint]
    scores: Mapping[str, Score]
    examples: Sequence[Example]
    path: NDArray[np.float64]
    fired: NDArray[np.float64]
    known: NDArray[np.int64]
    path_s: NDArray[np.float64] | None = None

    def as_json(self) -> dict[str, Any]:
        """What `report.json` holds: plain values, None where undefined."""
        return {
            "config": self.configuration.model_dump(mode="json"),
            "seed": self.seed,
            "versions": dict(self.versions),
            "facts": [list(fact) for fact in self.facts],
            "learning_curve": [
                {
                    "minute": minute,
                    "mean_auc_0_25_cm": _or_none(far),
                    "cells_0_25_cm": cells,
                    "mean_auc_0_15_cm": _or_none(near),
                }
                for minute, far, near, cells in self.curve
            ],
            "scores": {name: score.as_json() for name, score in self.scores.items()},
        }


def versions() -> dict[str, str]:
    """What a run rests on: Python, the libraries that shape its numbers, and the machine.

    >>> sorted(versions())
    ['llrp-online', 'numpy', 'onnxruntime', 'platform', 'python', 'torch']
    """
    found = {"python": platform.python_version()}
    for name in ("torch", "numpy", "onnxruntime", "llrp-online"):
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            found[name] = "not installed"
    return found | {"platform": platform.platform()}


def write(report: Report, folder: str | Path) -> Path:
    """Write `report.html` and `report.json`, each whole or not at all; the page's path."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    replace(folder / "report.json", json.dumps(report.as_json(), indent=1, allow_nan=False))
    replace(folder / "report.html", page(report))
    return folder / "report.html"


def page(report: Report) -> str:
    """The whole page."""
    return document(report.title, (table((), report.facts) if report.facts else "") + "".join(_sections(report)))


def _sections(report: Report) -> Iterator[str]:
    targets, sensors = report.configuration.targets.build().poses, report.configuration.sensors
    if shown := report.examples:
        drawn = figures.examples(
            [example.picture for example in shown],
            [example.labels for example in shown],
            [example.probabilities for example in shown],
            [example.caption for example in shown],
            targets,
            sensors,
        )
        what = "Camera pictures, each below its red heat map of predictions and its blue map of labels: "
        alt = what + "; ".join(example.caption for example in shown)
        note = "Predictions are of the moment; labels became known later, where the robot went."
        yield section("What it saw, predicted and found", image(drawn, alt, note))
    if report.curve:
        minutes, far, near, cells = zip(*report.curve, strict=True)
        drawn = figures.learning_curve(minutes, far, near, cells)
        told = ", ".join(f"{number(mean)} after {minute:g} min" for minute, mean in zip(minutes, far, strict=True))
        yield section("Learning curve", image(drawn, f"Mean AUC from 0 to 25 cm: {told}"))
    for name, score in report.scores.items():
        yield section(f"Score: {name}", _score(name, score))
    if np.isfinite(report.path[:, :2]).all(1).any():
        alt = f"Path of the robot by odometry, {len(report.path)} poses; sensors fired at {len(report.fired)} of them"
        yield section("Where it went", image(figures.trajectory(report.path, report.fired, report.path_s), alt))
    if report.known.any():
        negatives, positives = report.known.sum(0)
        alt = f"Known labels by distance: {negatives} negative and {positives} positive in all"
        yield section("Known labels", image(figures.known_labels(report.known, targets), alt))
    configuration = html.escape(json.dumps(report.configuration.model_dump(mode="json"), indent=1))
    origin = table((), [("seed", str(report.seed)), *report.versions.items()])
    yield section(
        "How to repeat it", f"{origin}<details><summary>configuration</summary><pre>{configuration}</pre></details>"
    )


def _score(name: str, score: Score) -> str:
    """Figures where an AUC is defined, and the table of every cell."""
    n = f"n+ {score.n_pos.sum():,}, n− {score.n_neg.sum():,}"
    parts = [f"<p>All known labels together: AUC {number(score.pooled_auc)} ({n}).</p>\n"]
    if not np.isnan(score.auc).all():
        low, high = np.nanmin(score.auc), np.nanmax(score.auc)
        reach = f"{name}: {number(low)} to {number(high)}, {n}"
        parts += [
            image(figures.auc_by_distance(score), f"AUC by distance of the target, {reach}"),
            image(figures.auc_map(score), f"Map of the AUC of each target and sensor, {reach}; values in the table"),
        ]
    heads = ("x [m]", "y [m]", "yaw [rad]", *score.sensors)
    rows = [
        [*(f"{value:.2f}" for value in pose), *(_cell(score, target, sensor) for sensor in range(len(score.sensors)))]
        for target, pose in enumerate(score.targets)
    ]
    legend = '<p class="note">AUC [95 % interval] n+/n−; blank where only one class is known.</p>\n'
    parts.append(f"<details><summary>every target and sensor</summary>{legend}{table(heads, rows)}</details>\n")
    return "".join(parts)


def _cell(score: Score, target: int, sensor: int) -> str:
    auc, low, high = (float(values[target, sensor]) for values in (score.auc, score.low, score.high))
    value = "" if math.isnan(auc) else f"{auc:.3f} "
    interval = "" if math.isnan(low) else f"[{low:.2f}, {high:.2f}] "
    return f"{value}{interval}{score.n_pos[target, sensor]}/{score.n_neg[target, sensor]}"


def _or_none(value: float | None) -> float | None:
    return None if value is None or math.isnan(value) else value
