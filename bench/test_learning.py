"""Learning per second of computing: the online learner over one recorded drive, compiled and plain."""

import time
from collections.abc import Callable
from contextlib import nullcontext
from itertools import count
from pathlib import Path

import pytest
from matplotlib.figure import Figure as Drawing

from agents import cli
from agents.commands.evaluate import exam_of
from agents.replayed import Marks, learn_over
from bench.rows import Figure, Row
from llrp_online.architecture import Weights
from llrp_online.configuration import RobotConfiguration, load
from llrp_online.figures.style import LINES, TEXT_PT, dress, new_figure, png
from llrp_online.learner import Learner
from llrp_online.scoring import mean_auc
from replay.compiling import plainly

CONFIG = Path("configs/thymio.toml")
FARTHEST_M = 0.25
PICTURE = Path("docs/pictures/learning_seconds.png")


@pytest.fixture
def drives(tmp_path: Path, short: bool) -> list[Path]:
    """A drive to learn from, and one through another layout to be judged by."""
    minutes = "1" if short else "10"
    paths = [tmp_path / "drive.mcap", tmp_path / "held_out.mcap"]
    for seed, path in enumerate(paths):
        words = ["record", "--simulate", "--minutes", minutes, "--seed", str(seed), "--config", str(CONFIG)]
        assert cli.main([*words, "--output", str(path)]) == 0
    return paths


def test_learning_per_second(drives: list[Path], record: Callable[[Row], None], short: bool) -> None:
    drive, held_out = drives
    configuration = load(CONFIG)
    exam = exam_of(configuration, [held_out])
    lived(configuration, held_out)  # once for nothing: the compiler and the first pages are not learning
    curves: dict[str, list[tuple[float, float]]] = {}
    for name, form in (("compiled", nullcontext), ("reference", plainly)):
        with form():
            seconds, weights = zip(*lived(configuration, drive), strict=True)
        curves[name] = [(s, mean_auc(exam.score(w), FARTHEST_M)[0]) for s, w in zip(seconds, weights, strict=True)]
    if not short:
        PICTURE.write_bytes(png(drawn(curves)))
    (ours_s, auc), (reference_s, reference_auc) = (points[-1] for points in curves.values())
    record(
        Row(
            f"online learner over a recorded drive of {len(curves['compiled'])} robot minutes, with all it does",
            Figure([ours_s]),
            {"the plain reference": Figure([reference_s])},
            {"the plain reference": 1.5},
            note=f"mean AUC at 0 to 25 cm in another layout, at the end: {auc:.3f}, reference {reference_auc:.3f}",
        )
    )


def lived(configuration: RobotConfiguration, drive: Path) -> list[tuple[float, Weights]]:
    """Learn over the drive; seconds and weights at each whole robot minute."""
    learner, found = Learner(configuration), list[tuple[float, Weights]]()
    start = time.perf_counter()
    keep = lambda _lived_s: found.append((time.perf_counter() - start, learner.trainer.weights()))  # noqa: E731
    learn_over(learner, [drive], Marks(learner, count(60, 60), keep))
    return found


def drawn(curves: dict[str, list[tuple[float, float]]]) -> Drawing:
    """AUC against seconds; one line a form, one marker a robot minute."""
    figure = new_figure(4.2, 2.9)
    axes = figure.add_subplot()
    for (name, points), (colour, marker, dash) in zip(curves.items(), LINES, strict=False):
        axes.plot(*zip(*points, strict=True), color=colour, marker=marker, linestyle=dash, markersize=4, label=name)
    dress(axes, "seconds of computing", "mean AUC on held-out frames, 0 to 25 cm")
    axes.set_xlim(left=0)
    axes.legend(fontsize=TEXT_PT, frameon=False, title="one marker a robot minute", title_fontsize=TEXT_PT)
    return figure
