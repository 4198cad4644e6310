"""The compiled walk against the plain one: the same numbers, whatever the scores and however often a frame counts."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from llrp_online.resampling import (
    Ranking,
    Won,
    plain_pairs_won,
    plain_ranking,
    ranking,
    resampled_auc,
)
from llrp_online.resampling_kernels import build

KERNELS = build()
TIES = st.sampled_from([-1.5, -0.0, 0.0, 0.25, 0.5, 1.0, 3e38])
ANY = st.floats(allow_nan=False, width=32)


@st.composite
def cells(draw):
    """One cell, many ties or few, of any classes; what is unknown may be NaN."""
    count = draw(st.integers(0, 40))
    labels = draw(arrays.arrays(np.int8, count, elements=draw(st.sampled_from([st.integers(-1, 1), st.just(1)]))))
    scores = draw(arrays.arrays(np.float32, count, elements=draw(st.sampled_from([TIES, ANY]))))
    return np.where(labels < 0, np.float32(draw(st.sampled_from([0.3, np.nan]))), scores), labels


@settings(deadline=None)
@given(cells())
def test_ranks_are_those_of_the_plain_form(cell):
    scores, labels = cell
    plain = plain_ranking(scores, labels)
    fast = Ranking(*KERNELS.rank(scores, labels))
    np.testing.assert_array_equal(fast.scores, plain.scores)
    assert (fast.scores[1:] >= fast.scores[:-1]).all()
    assert sorted(fast.rows) == sorted(plain.rows)
    np.testing.assert_array_equal(scores[fast.rows], fast.scores)
    np.testing.assert_array_equal(labels[fast.rows] == 1, fast.positive)


@settings(deadline=None)
@given(cells(), st.integers(1, 9), st.sampled_from([np.float32, np.float64]), st.data())
def test_pairs_won_are_those_of_the_plain_form(cell, rounds, kind, data):
    scores, labels = cell
    ranked = plain_ranking(scores.astype(kind), labels)
    times = data.draw(arrays.arrays(np.int32, (len(labels), rounds), elements=st.sampled_from([0, 0, 1, 2, 70_000])))
    fast = Won(*KERNELS.pairs_won(*ranked, times))
    for found, expected in zip(fast, plain_pairs_won(ranked, times), strict=True):
        np.testing.assert_array_equal(found, expected)


@settings(deadline=None)
@given(cells(), st.data())
def test_a_frame_that_counts_twice_is_two_frames(cell, data):
    scores, labels = cell
    times = data.draw(arrays.arrays(np.int32, len(labels), elements=st.integers(0, 3)))
    repeated = np.repeat(np.arange(len(labels)), times)
    once = np.ones((len(repeated), 1), np.int32)
    expected = resampled_auc(ranking(scores[repeated], labels[repeated]), once)
    np.testing.assert_array_equal(resampled_auc(ranking(scores, labels), times[:, None]), expected)
