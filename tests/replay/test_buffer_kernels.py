"""What the buffer computes, compiled and plain: the same answers, bit for bit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from replay import class_counts, duplicates, policies
from replay.buffer import BufferSettings, ReplayBuffer
from replay.buffer_kernels import KERNELS

SEEDS = st.integers(0, 10**6)


@pytest.fixture(scope="module")
def kernels():
    compiled = KERNELS.get()
    assert compiled is not None
    return compiled


def some_labels(rng, *shape):
    return rng.integers(-1, 2, shape).astype(np.int8)


@given(st.tuples(st.integers(1, 40), st.integers(1, 40), st.integers(1, 9)), SEEDS)
def test_thumbnails(kernels, shape, seed):
    picture = np.random.default_rng(seed).integers(0, 256, shape, dtype=np.uint8)
    thumb = duplicates.thumbnail(picture)
    np.testing.assert_array_equal(kernels.thumbnail(picture), thumb)
    if shape[0] % 8 == shape[1] % 8 == 0:
        parts = picture.reshape(8, shape[0] // 8, 8, shape[1] // 8, -1).mean((1, 3, 4))
        assert (np.abs(thumb.reshape(8, 8) - parts + 0.5) <= 0.5 + 1e-9).all()


@given(st.integers(0, 12), st.integers(1, 70), st.floats(0.1, 6.0), SEEDS)
def test_repetitions(kernels, others, entries, distance, seed):
    rng = np.random.default_rng(seed)
    mine = rng.integers(0, 250, duplicates.PIXELS, dtype=np.uint8)
    labels = np.where(rng.random((20, entries)) < 0.05, some_labels(rng, 20, entries), np.int8(1))
    thumbnails = mine + rng.integers(0, 6, (others, duplicates.PIXELS), dtype=np.uint8)
    slots = rng.integers(0, 20, others)
    ids_now = rng.integers(0, 2, 20)
    question = (mine, labels[0], thumbnails, slots, np.ones(others, np.int64), ids_now, labels, distance)
    assert kernels.repeats(*question) == duplicates.repeats(*question)


@given(st.integers(1, 20), st.integers(1, 40), st.floats(0, 1), st.floats(0, 1), SEEDS)
def test_who_is_poorest(kernels, frames, entries, positives, floor, seed):
    rng = np.random.default_rng(seed)
    labels = some_labels(rng, 30, entries)
    labels[(labels == 1) & (rng.random(labels.shape) > positives)] = 0
    counts = rng.integers(0, 50, (2, entries))
    question = (rng.integers(0, 30, frames + 1), labels, counts, floor)
    assert kernels.poorest(*question) == policies.poorest(*question)


@given(st.integers(0, 12), st.integers(1, 70), SEEDS)
def test_counts(kernels, updates, entries, seed):
    rng = np.random.default_rng(seed)
    labels, weight = some_labels(rng, 8, entries), rng.random((8, entries), np.float32)
    slots, new = rng.integers(-1, 8, updates), some_labels(rng, updates, entries)
    new_weight = rng.random((updates, entries), np.float32)
    found = []
    for form in (kernels, class_counts):
        kept, kept_weight, counts = labels.copy(), weight.copy(), np.zeros((2, entries), np.int64)
        for row in kept:
            form.tally(row, 1, counts)
        form.replace(slots, new, new_weight, kept, kept_weight, counts)
        np.testing.assert_array_equal(counts, [(kept == 0).sum(0), (kept == 1).sum(0)])
        form.tally(kept[0], -1, counts)
        found.append((kept, kept_weight, counts))
    for compiled, plain in zip(*found, strict=True):
        np.testing.assert_array_equal(compiled, plain)


@pytest.mark.parametrize("policy", ["balanced", "reservoir", "fifo"])
def test_a_life_of_the_buffer(monkeypatch, policy):
    settings = BufferSettings(60 * 600, 8, policy=policy, duplicate_distance=20.0)

    def lived():
        buffer, rng = ReplayBuffer((8, 8, 3), (3, 2), settings), np.random.default_rng(5)
        for number in range(300):
            picture = rng.integers(0, 40, (8, 8, 3), dtype=np.uint8) + np.uint8(rng.integers(0, 200))
            buffer.add(number, picture, some_labels(rng, 3, 2), rng.random((3, 2), np.float32))
            buffer.update(number // 2, some_labels(rng, 3, 2), rng.random((3, 2), np.float32))
            buffer.sample(8)
        return buffer

    compiled = lived()
    monkeypatch.setattr(KERNELS, "get", lambda: None)
    plain = lived()
    assert compiled.duplicates == plain.duplicates > 10
    for name, array in compiled.state().items():
        np.testing.assert_array_equal(array, plain.state()[name], err_msg=name)
    np.testing.assert_array_equal(compiled.class_counts, plain.class_counts)
