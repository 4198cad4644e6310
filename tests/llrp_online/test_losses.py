import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from llrp_online import losses

torch.set_num_threads(1)

SHAPE = (3, 4, 2)
LABELS = arrays.arrays(np.int8, SHAPE, elements=st.integers(-1, 1))
WEIGHTS = arrays.arrays(np.float32, SHAPE, elements=st.floats(0, 1, width=32))
LOGITS = arrays.arrays(np.float32, SHAPE, elements=st.floats(-80, 80, width=32))
LOSSES = [losses.paper, losses.cross_entropy]


def gradient(loss, logits, labels, weight):
    leaf = torch.tensor(logits, requires_grad=True)
    value = loss(leaf, torch.tensor(labels), torch.tensor(weight))
    value.backward()
    return float(value.detach()), leaf.grad.numpy()


@pytest.mark.parametrize("loss", LOSSES)
@settings(deadline=None, max_examples=60)
@given(logits=LOGITS, labels=LABELS, weight=WEIGHTS)
def test_an_unknown_label_has_exactly_zero_gradient(loss, logits, labels, weight):
    value, found = gradient(loss, logits, labels, weight)
    assert np.isfinite(value)
    assert np.isfinite(found).all()
    assert (found[labels < 0] == 0).all()


@pytest.mark.parametrize("loss", LOSSES)
def test_not_even_an_infinite_logit_leaks_through_an_unknown_label(loss):
    labels = np.full(SHAPE, 1, np.int8)
    labels[0] = -1
    logits = np.zeros(SHAPE, np.float32)
    logits[0, 0, 0], logits[0, 0, 1] = np.inf, np.nan
    value, found = gradient(loss, logits, labels, np.ones(SHAPE, np.float32))
    assert np.isfinite(value)
    assert (found[0] == 0).all()


@pytest.mark.parametrize("loss", LOSSES)
def test_a_batch_without_known_labels_costs_nothing(loss):
    value, found = gradient(loss, np.ones(SHAPE, np.float32), np.full(SHAPE, -1, np.int8), np.ones(SHAPE, np.float32))
    assert value == 0
    assert (found == 0).all()


@settings(deadline=None, max_examples=60)
@given(logits=LOGITS, labels=LABELS, weight=WEIGHTS)
def test_paper_averages_over_all_entries(logits, labels, weight):
    error = np.where(labels >= 0, 1 / (1 + np.exp(-logits.astype(np.float64))) - labels, 0)
    value, _ = gradient(losses.paper, logits, labels, weight)
    assert value == pytest.approx((weight * error**2).mean(), abs=1e-6)


@settings(deadline=None, max_examples=60)
@given(logits=LOGITS, labels=LABELS, weight=WEIGHTS)
def test_cross_entropy_averages_over_known_labels(logits, labels, weight):
    known = labels >= 0
    signed = np.where(labels == 1, logits, -logits).astype(np.float64)
    entropy = np.logaddexp(0, -signed) * weight
    value, _ = gradient(losses.cross_entropy, logits, labels, weight)
    assert value == pytest.approx(entropy[known].sum() / max(known.sum(), 1), rel=1e-5, abs=1e-6)


def test_more_unknown_labels_do_not_shrink_the_cross_entropy():
    logits, weight = torch.zeros(2, 3, 1), torch.ones(2, 3, 1)
    dense, sparse = torch.ones(2, 3, 1, dtype=torch.int8), torch.full((2, 3, 1), -1, dtype=torch.int8)
    sparse[0, 0, 0] = 1
    assert losses.cross_entropy(logits, dense, weight) == losses.cross_entropy(logits, sparse, weight)
    assert losses.paper(logits, dense, weight) == 6 * losses.paper(logits, sparse, weight)


def test_positive_weights_count_for_positives_alone():
    labels = torch.tensor([[[1], [0]], [[0], [1]]], dtype=torch.int8)
    logits = torch.zeros(2, 2, 1, requires_grad=True)
    losses.cross_entropy(logits, labels, torch.ones(2, 2, 1), torch.tensor([[3.0], [2.0]])).backward()
    assert logits.grad is not None
    assert logits.grad.flatten().mul(8).tolist() == [-3, 1, 1, -2]


def test_positive_weights_are_clipped():
    counts = np.array([[[100, 10], [100, 50]], [[5, 100], [0, 0]]])
    assert losses.positive_weights(counts, 4.0).tolist() == [[4, 2], [1, 1]]
    assert losses.positive_weights(counts, 1.0).tolist() == [[1, 1], [1, 1]]
