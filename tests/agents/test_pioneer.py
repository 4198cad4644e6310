"""The Pioneer's study: its drives, trials and findings, on drives of seconds."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from agents.experiments import pioneer
from agents.experiments.findings import section
from agents.experiments.pioneer_cells import Cells
from agents.experiments.pioneer_drives import PioneerDrive, Recorded
from agents.experiments.pioneer_learning import live, resampled
from agents.experiments.pioneer_published import published
from agents.experiments.settings import changed, configuration_of
from llrp_online.learner import Learner
from llrp_online.metrics import auc

TINY = replace(pioneer.QUICK, minutes=0.1, steps=2, paper_steps=2)
ROBOT = configuration_of("pioneer")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("drives")


def _drive(minutes: float = 0.3, margin_m: float = 1.0) -> PioneerDrive:
    world = pioneer.world().model_dump(mode="json")
    world["drive"]["margin_m"] = margin_m
    return PioneerDrive(ROBOT.model_dump(mode="json"), world, 0, minutes)


def test_a_drive_is_the_same_wherever_it_is_driven(tmp_path: Path) -> None:
    first, second = (_drive(0.1).recorded(tmp_path / name) for name in ("a", "b"))
    for name in Recorded.__annotations__:
        assert np.array_equal(getattr(first, name), getattr(second, name))
    assert first.greys.shape == (120, 64, 80, 3)
    assert first.pictures(np.array([7, 8])).shape == (2, *ROBOT.picture_shape)


def test_labels_are_the_floor_at_the_targets(folder: Path) -> None:
    drive = _drive().recorded(folder)
    targets = ROBOT.targets.build().poses
    under = int(np.flatnonzero((targets[:, :2] == 0).all(1))[0])
    assert np.array_equal(drive.labels[:, under, 0], (drive.grey < 0.5).astype(np.int8))
    # Two seconds at 0.5 m/s: one metre, along a gentle arc.
    ahead = int(np.flatnonzero(np.isclose(targets[:, :2], [1.0, 0.0]).all(1))[0])
    known = np.flatnonzero(drive.labels[:-60, ahead, 0] >= 0)
    assert len(known) > 10
    later = drive.grey[known + 40]
    clear = (later == 0) | (later == 1)
    assert (drive.labels[known[clear], ahead, 0] == (later[clear] == 0)).mean() > 0.95


def test_nothing_is_matched_across_a_new_beginning(folder: Path) -> None:
    drive = _drive(margin_m=22.0).recorded(folder)
    begins = np.flatnonzero(np.diff(drive.trajectory)) + 1
    assert len(begins) >= 1
    targets = ROBOT.targets.build().poses
    ahead = (targets[:, 0] > 0.15) & (targets[:, 1] == 0)
    behind = (targets[:, 0] < -0.15) & (targets[:, 1] == 0)
    # The last moment of a trajectory knows nothing ahead of it, though the next one begins with readings.
    assert (drive.labels[begins[0] - 1][ahead] == -1).all()
    assert (drive.labels[begins[0]][behind] == -1).all()
    assert (drive.labels[begins[0] + 40][behind] >= 0).any()


def test_living_event_by_event_knows_the_labels_that_all_at_once_knows(folder: Path) -> None:
    drive = _drive(margin_m=22.0).recorded(folder)
    learner = Learner(changed(ROBOT, {"training.steps_per_second": 0.1, "memory.budget_mb": 80.0}))
    live(learner, drive)
    expected = np.stack([(drive.labels == 0).sum(0), (drive.labels == 1).sum(0)], -1)
    assert np.array_equal(learner.closed_counts, expected)
    assert learner.trainer.steps >= 1


def test_resampling_draws_whole_trajectories() -> None:
    rng = np.random.default_rng(0)
    labels = rng.integers(-1, 2, (400, 3)).astype(np.int8)
    scores = (0.3 * labels + rng.random((400, 3))).astype(np.float32)
    group = np.repeat(np.arange(8), 50)
    found, rounds = resampled(scores, labels, group, 200, 0)
    assert np.array_equal(found, auc(scores[..., None], labels[..., None])[:, 0])
    assert (np.percentile(rounds, 2.5, axis=0) < found).all()
    assert (np.percentile(rounds, 97.5, axis=0) > found).all()
    # The same frames eight times over are no more evidence than once.
    again = np.tile(np.arange(400).reshape(8, 50), (1, 8)).ravel()
    _, wide = resampled(scores[again], labels[again], group.repeat(8), 200, 0)
    assert wide.std(0) == pytest.approx(rounds.std(0), rel=1e-6)


def test_what_one_trajectory_knows_has_no_interval() -> None:
    labels = np.array([[0, 0], [1, 1], [-1, 0], [-1, 1]], np.int8)
    scores = np.array([[0.1, 0.1], [0.9, 0.9], [0.5, 0.8], [0.5, 0.2]], np.float32)
    found, rounds = resampled(scores, labels, np.array([0, 0, 1, 1]), 50, 0)
    assert found.tolist() == [1.0, 0.75]
    assert np.isnan(rounds[:, 0]).all()
    assert not np.isnan(rounds[:, 1]).all()


def test_the_paper_is_read_the_right_way_round() -> None:
    targets, paper = ROBOT.targets.build().poses, published()

    def cell(x_m: float, y_m: float) -> tuple[float, int]:
        (row,) = np.flatnonzero(np.isclose(targets[:, :2], [x_m, y_m]).all(1))
        return float(paper.auc[row]), int(paper.known_labels[row])

    assert cell(5.0, 4.0) == (0.54, 649)
    assert cell(-3.0, -4.0) == (0.5, 342)
    assert cell(2.5, 0.5) == (0.86, 6225)
    assert cell(-1.0, 0.0)[0] == 0.95
    assert np.isnan(cell(1.0, 1.0)[0])
    # As the issue has them, which were read off the figure's greys.
    means = [paper.auc[paper.cells(fewest)].mean() for fewest in (1000, 5000)]
    assert means == pytest.approx([0.639, 0.755], abs=0.002)


def test_means_leave_out_what_is_undefined() -> None:
    result = {
        "auc": [0.8, None],
        "rounds": [[0.7, None], [0.9, None]],
        "n_pos": [5, 0],
        "n_neg": [6, 3],
        "learned": [10, 1],
        "trajectories": 2,
    }
    other = {**result, "auc": [0.6, None], "rounds": [[0.5, None], [0.7, None]], "learned": [11, 3]}
    cells = Cells.of(np.array([[0.0, 0, 0], [1.0, 0, 0]]), [result, other], seeds=1)
    value, interval, count = cells.mean(np.array([True, True]))
    assert value == pytest.approx(0.7)
    assert interval == pytest.approx((0.605, 0.795))
    assert count == 1
    assert cells.mean(np.array([False, True])) == (None, None, 0)
    assert cells.n_pos.tolist() == [10, 0]
    assert cells.known.tolist() == [21, 4]


def test_a_tiny_study_tells_every_cell_beside_the_papers(folder: Path) -> None:
    trials = pioneer.trials(TINY)
    assert len({trial.name for trial in trials}) == len(trials) == 6
    for trial in trials:
        learned, tested = ({drive["seed"] for drive in trial.parameters[part]} for part in ("learned", "tested"))
        assert not learned & tested
    results = [trial.run(folder) for trial in trials]
    assert trials[0].run(folder) == results[0]
    found = pioneer.findings(TINY, results)
    cells = found.numbers["cells"]["offline"]
    assert len(cells) == 289
    assert cells[0]["x_m"] == -3.0
    assert all(cell["auc"] is None for cell in cells if 0 in (cell["n_pos"], cell["n_neg"]))
    assert {plot.name for plot in found.plots} >= {"known_labels", "auc_offline", "auc_online", "rig"}
    text = section(found, "llrp experiment pioneer", "one trial")
    assert "### AUC of every cell, offline\n" in text
    grid = [line for line in text.splitlines() if line.startswith("| 5 |")]
    assert all(line.count("/") == 17 for line in grid)
    assert len(grid) == 3
