import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from llrp_online.metrics import Score, auc, bootstrap, counts, pooled_auc

SHAPE = st.tuples(st.integers(1, 12), st.integers(1, 3), st.integers(1, 2))


@st.composite
def predictions(draw):
    """Scores of few distinct values, so that there are many ties, and labels of all three kinds."""
    shape = draw(SHAPE)
    scores = draw(arrays.arrays(np.float32, shape, elements=st.sampled_from([0.0, 0.25, 0.5, 0.75, 1.0])))
    labels = draw(arrays.arrays(np.int8, shape, elements=st.integers(-1, 1)))
    return scores, labels


def by_pairs(scores, labels):
    """The definition: over all pairs of a positive and a negative, 1 if the positive scores more, 1/2 if the same."""
    positive, negative = scores[labels == 1], scores[labels == 0]
    if not len(positive) or not len(negative):
        return np.nan
    difference = positive[:, None].astype(np.float64) - negative[None, :]
    return ((difference > 0) + 0.5 * (difference == 0)).mean()


@settings(deadline=None)
@given(predictions())
def test_auc_is_its_definition(given_predictions):
    scores, labels = given_predictions
    found = auc(scores, labels)
    for cell in np.ndindex(*labels.shape[1:]):
        np.testing.assert_allclose(found[cell], by_pairs(scores[:, *cell], labels[:, *cell]), rtol=1e-12)
    np.testing.assert_allclose(pooled_auc(scores, labels), by_pairs(scores, labels), rtol=1e-12)


@settings(deadline=None)
@given(predictions())
def test_counts_are_of_known_labels(given_predictions):
    _, labels = given_predictions
    n_pos, n_neg = counts(labels)
    assert (n_pos + n_neg + (labels < 0).sum(0) == len(labels)).all()
    assert (n_pos == np.maximum(labels, 0).sum(0)).all()


@settings(deadline=None, max_examples=30)
@given(predictions(), st.integers(0, 5))
def test_bootstrap_is_the_percentiles_of_auc_over_resampled_frames(given_predictions, seed):
    scores, labels = given_predictions
    low, high = bootstrap(scores, labels, rounds=60, seed=seed)
    rng = np.random.default_rng(seed)
    rounds = []
    for _ in range(60):
        drawn = rng.integers(0, len(labels), len(labels))
        rounds.append(auc(scores[drawn], labels[drawn]))
    for cell in np.ndindex(*labels.shape[1:]):
        values = [found[cell] for found in rounds if not np.isnan(found[cell])]
        expected = np.percentile(values, [2.5, 97.5]) if values else [np.nan, np.nan]
        np.testing.assert_allclose([low[cell], high[cell]], expected, rtol=1e-12)


def test_intervals_cover_the_truth_about_as_often_as_they_say():
    rng = np.random.default_rng(0)
    labels = (rng.random((400, 100, 1)) < 0.3).astype(np.int8)
    scores = rng.standard_normal(labels.shape) + labels
    low, high = bootstrap(scores, labels, rounds=100)
    truth = 0.7602  # P(N(1, 2) > 0)
    assert 0.88 <= ((low <= truth) & (truth <= high)).mean() <= 1


def test_unknown_labels_may_have_any_score():
    scores, labels = np.array([0.2, np.nan, 0.8]), np.array([0, -1, 1], np.int8)
    assert pooled_auc(scores, labels) == 1


def test_errors_say_what_was_wrong():
    labels = np.zeros((2, 1, 1), np.int8)
    with pytest.raises(ValueError, match=r"same shape, got \(3, 1, 1\) and \(2, 1, 1\)"):
        auc(np.zeros((3, 1, 1)), labels)
    with pytest.raises(ValueError, match="finite"):
        auc(np.full((2, 1, 1), np.nan), labels)


def test_a_score_is_this_json_object():
    targets = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]])
    scores = np.array([[[0.1], [0.5]], [[0.9], [0.5]], [[0.2], [0.6]]])
    labels = np.array([[[0], [1]], [[1], [1]], [[0], [-1]]], np.int8)
    score = Score.of(scores, labels, targets, ["floor"], rounds=100)
    found = json.loads(json.dumps(score.as_json(), allow_nan=False))
    assert list(found) == ["targets", "sensors", "auc", "low", "high", "n_pos", "n_neg", "pooled_auc"]
    assert found["targets"] == targets.tolist()
    assert found["sensors"] == ["floor"]
    assert found["auc"] == [[1.0], [None]]
    assert found["low"] == [[1.0], [None]]
    assert found["high"] == [[1.0], [None]]
    assert found["n_pos"] == [[1], [2]]
    assert found["n_neg"] == [[2], [0]]
    assert found["pooled_auc"] == 1.0


def test_nothing_known_is_null_everywhere():
    found = Score.of(np.zeros((1, 1, 1)), np.full((1, 1, 1), -1, np.int8), np.zeros((1, 3)), ["a"]).as_json()
    assert (found["auc"], found["low"], found["pooled_auc"]) == ([[None]], [[None]], None)


def test_a_score_comes_back_from_its_json():
    labels = np.array([[[0], [1]], [[1], [1]], [[0], [-1]]], np.int8)
    score = Score.of(np.linspace(0, 1, 6).reshape(3, 2, 1), labels, np.zeros((2, 3)), ["floor"], rounds=10)
    assert Score.of_json(json.loads(json.dumps(score.as_json()))).as_json() == score.as_json()
