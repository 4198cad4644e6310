import itertools

import numpy as np
import pytest

from llrp_online.metrics import auc, counts, pooled_auc
from llrp_online.prequential import Prequential
from replay.targets import Targets

LINE = Targets.line(0.0, 0.30, 0.01).poses
SENSORS = ["left", "right"]
SHAPE = (len(LINE), len(SENSORS))


def frames(count, seed=0):
    rng = np.random.default_rng(seed)
    labels = rng.integers(-1, 2, (count, *SHAPE)).astype(np.int8)
    probabilities = np.clip(0.5 + 0.2 * labels + 0.3 * rng.standard_normal(labels.shape), 0, 1).astype(np.float32)
    return probabilities, labels


def resolved(evaluation, frame, labels, *, closed):
    """One frame's losses, once it is closed."""
    return evaluation.resolved(np.array([frame]), labels[None], np.array([closed])).get(0)


def test_the_score_is_that_of_the_window():
    probabilities, labels = frames(50)
    evaluation = Prequential(LINE, SENSORS, capacity=20)
    for frame in range(50):
        evaluation.predicted(frame, probabilities[frame])
        resolved(evaluation, frame, labels[frame], closed=True)
    score = evaluation.score(rounds=20)
    np.testing.assert_array_equal(score.auc, auc(probabilities[30:], labels[30:]))
    assert score.pooled_auc == pooled_auc(probabilities[30:], labels[30:])
    assert (score.n_pos + score.n_neg).sum() == (labels[30:] >= 0).sum()
    assert (score.low <= score.high)[~np.isnan(score.low)].all()


def test_the_prediction_of_frame_time_meets_the_last_value_of_its_labels():
    probabilities, labels = frames(10)
    evaluation = Prequential(LINE, SENSORS, capacity=100)
    for frame in range(10):
        evaluation.predicted(frame, probabilities[frame])
    for frame in reversed(range(10)):
        assert resolved(evaluation, frame, np.where(labels[frame] == 1, 0, -1).astype(np.int8), closed=False) is None
    for frame in range(10):
        resolved(evaluation, frame, labels[frame], closed=frame % 2 == 0)
    assert evaluation.score().pooled_auc == pooled_auc(probabilities, labels)


def test_bands_hold_equally_many_distances_and_every_label_once():
    probabilities, labels = frames(40)
    evaluation = Prequential(LINE, SENSORS, capacity=40)
    for frame in range(40):
        evaluation.predicted(frame, probabilities[frame])
        resolved(evaluation, frame, labels[frame], closed=True)
    bands = evaluation.bands()
    assert [(band.low_m, band.high_m) for band in bands] == evaluation.band_edges_m
    assert evaluation.band_edges_m == [(0.0, 0.07), (0.08, 0.15), (0.16, 0.23), (0.24, 0.30)]
    assert sum(band.n_pos + band.n_neg for band in bands) == (labels >= 0).sum()
    second = slice(8, 16)
    assert bands[1].auc == pooled_auc(probabilities[:, second], labels[:, second])
    assert bands[1].n_pos == counts(labels[:, second])[0].sum()
    known = labels[:, second] >= 0
    p, y = probabilities[:, second][known].astype(np.float64), labels[:, second][known]
    expected = -np.log(np.maximum(np.where(y == 1, p, 1 - p), 1e-4)).mean()
    assert bands[1].log_loss == pytest.approx(expected)


def test_the_newest_frames_alone():
    probabilities, labels = frames(25)
    evaluation = Prequential(LINE, SENSORS, capacity=20)
    for frame in range(25):
        evaluation.predicted(frame, probabilities[frame])
        resolved(evaluation, frame, labels[frame], closed=True)
    for newest in (7, 20, 1000):
        part = slice(25 - min(newest, 20), 25)
        assert evaluation.bands(newest)[0].auc == pooled_auc(probabilities[part, :8], labels[part, :8])


def test_a_grid_is_banded_by_distance_from_the_robot():
    grid = Targets.grid([-3.0, 5.0, 0.5], [-4.0, 4.0, 0.5]).poses
    edges = Prequential(grid, ["floor"], capacity=1).band_edges_m
    assert len(edges) == 4
    assert edges[0][0] == 0
    assert edges[-1][1] == pytest.approx(np.hypot(5, 4))
    assert all(near[1] < far[0] for near, far in itertools.pairwise(edges))
    assert Prequential(grid[:2], ["floor"], capacity=1).band_edges_m != edges
    assert len(Prequential(grid[:2], ["floor"], capacity=1).band_edges_m) == 2


def test_a_closed_frame_gives_one_loss_a_band():
    evaluation = Prequential(LINE, SENSORS, capacity=5)
    evaluation.predicted(3, np.full(SHAPE, 0.8, np.float32))
    labels = np.full(SHAPE, -1, np.int8)
    labels[0, 0], labels[1, 1], labels[30, 0] = 1, 0, 1
    assert resolved(evaluation, 3, labels, closed=False) is None
    losses = resolved(evaluation, 3, labels, closed=True)
    expected = [-(np.log(0.8) + np.log(0.2)) / 2, np.nan, np.nan, -np.log(0.8)]
    np.testing.assert_allclose(losses, expected, rtol=1e-5)


def test_certainty_that_proves_wrong_costs_much_but_not_infinitely():
    evaluation = Prequential(LINE[:1], ["a"], capacity=5)
    evaluation.predicted(0, np.ones((1, 1), np.float32))
    losses = resolved(evaluation, 0, np.zeros((1, 1), np.int8), closed=True)
    assert losses is not None
    assert losses[0] == pytest.approx(-np.log(1e-4))


def test_frames_without_prediction_are_passed_over():
    evaluation = Prequential(LINE, SENSORS, capacity=2)
    labels = np.ones(SHAPE, np.int8)
    assert resolved(evaluation, 5, labels, closed=True) is None
    for frame in range(3):
        evaluation.predicted(frame, np.zeros(SHAPE, np.float32))
    assert resolved(evaluation, 0, labels, closed=True) is None  # it left the window
    assert evaluation.score().n_pos.sum() == 0
    assert evaluation.bands()[0][2:] == (None, 0, 0, None)


def test_nothing_yet_is_a_score_too():
    score = Prequential(LINE, SENSORS, capacity=2).score(rounds=10)
    assert np.isnan(score.pooled_auc)


def test_errors_say_what_was_expected():
    evaluation = Prequential(LINE, SENSORS, capacity=2)
    evaluation.predicted(0, np.zeros(SHAPE, np.float32))
    with pytest.raises(ValueError, match="frame 0: its prediction is kept already"):
        evaluation.predicted(0, np.zeros(SHAPE, np.float32))
    with pytest.raises(ValueError, match=r"expected shape \(31, 2\), got \(2,\)"):
        evaluation.predicted(1, np.zeros(2, np.float32))
    with pytest.raises(ValueError, match=r"expected labels \(1, 31, 2\) and closed \(1,\), got shapes \(1, 1, 2\)"):
        resolved(evaluation, 0, np.zeros((1, 2), np.int8), closed=True)
    with pytest.raises(ValueError, match="got 0"):
        Prequential(LINE, SENSORS, capacity=0)


def test_many_at_once_are_as_one_by_one():
    probabilities, labels = frames(12)
    together, apart = (Prequential(LINE, SENSORS, capacity=8) for _ in range(2))
    for evaluation, frame in itertools.product((together, apart), range(12)):
        evaluation.predicted(frame, probabilities[frame])
    ids, closed = np.arange(12)[::-1], np.arange(12) % 3 == 0  # 0 to 3 have left the window
    losses = together.resolved(ids, labels[ids], closed)
    for index, (frame, ends) in enumerate(zip(ids.tolist(), closed.tolist(), strict=True)):
        expected = resolved(apart, frame, labels[frame], closed=ends)
        assert (index in losses) == (expected is not None)
        if expected is not None:
            np.testing.assert_array_equal(losses[index], expected)
    np.testing.assert_array_equal(together.score().auc, apart.score().auc)
    assert together.bands() == apart.bands()
    with pytest.raises(ValueError, match=r"expected labels \(2, 31, 2\) and closed \(2,\), got shapes \(3, 31, 2\)"):
        together.resolved(ids[:2], labels[:3], closed[:2])
