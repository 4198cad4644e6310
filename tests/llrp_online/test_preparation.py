"""Augmented and standardised in one compiled pass, or plainly: the same, but for rounding."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from llrp_online.augment import Augmenter, grains
from llrp_online.configuration.learning import Augmentation
from llrp_online.mirror import Mirror
from llrp_online.network import standardise
from llrp_online.preparation import Preparation
from replay.batch import Batch

PROBABILITY = st.sampled_from([0.0, 0.5, 1.0])


def plainly(prepare):
    """The same preparation without compiled code."""
    plain = Preparation(prepare._augment)
    plain._compiled.get = lambda: None
    return plain


def augmenter(rng, settings, cameras, targets, sensors):
    """Of a rig with a mirror image, or, where nothing is flipped, of one without."""
    if not settings.flip:
        return Augmenter(settings, None)
    return Augmenter(settings, Mirror(rng.permutation(targets), rng.permutation(sensors), rng.permutation(cameras)))


def a_batch(rng, size, picture, label, flat=False):
    frames = 7
    pictures = rng.integers(0, 256, (frames, *picture), dtype=np.uint8)
    if flat:  # a covered lens
        pictures[:] = 255
    labels = rng.integers(-1, 2, (frames, *label)).astype(np.int8)
    return Batch(pictures, labels, rng.random(labels.shape, np.float32), rng.integers(0, frames, size))


@given(
    st.builds(
        Augmentation,
        flip=PROBABILITY,
        noise=PROBABILITY,
        grey=PROBABILITY,
        shadow=PROBABILITY,
        colour=PROBABILITY,
        noise_deviation=st.floats(0, 0.2),
        shadow_strength=st.floats(0, 1),
    ),
    st.tuples(st.integers(1, 12), st.integers(1, 20), st.integers(1, 4)),
    st.tuples(st.integers(1, 5), st.integers(1, 4)),
    st.integers(1, 9),
    st.booleans(),
    st.integers(0, 10**6),
)
def test_both_forms_agree(settings, picture, label, size, flat, seed):
    height, width, cameras = picture
    rng = np.random.default_rng(seed)
    prepare = Preparation(augmenter(rng, settings, cameras, *label))
    batch = a_batch(rng, size, (height, width, 3 * cameras), label, flat)
    kept = [array.copy() for array in batch.frames]
    randoms = [np.random.default_rng(seed) for _ in range(2)]
    compiled, plain = (form(batch, random) for form, random in zip((prepare, plainly(prepare)), randoms, strict=True))
    # At 255 float32 is rounded by up to 1.5e-5, and a covered lens has no deviation to divide that by; a turn of
    # the colours may put what all three are wrong by into one.
    atol = 1e-4 * (3**0.5 if settings.colour else 1)
    np.testing.assert_allclose(compiled.pictures, plain.pictures, rtol=1e-5, atol=atol)
    np.testing.assert_array_equal(compiled.labels, plain.labels)
    np.testing.assert_array_equal(compiled.weight, plain.weight)
    for one, other in zip(compiled, plain, strict=True):
        assert (one.dtype, one.shape, one.flags.c_contiguous) == (other.dtype, other.shape, True)
    assert randoms[0].random() == randoms[1].random()
    assert all(np.array_equal(before, after) for before, after in zip(kept, batch.frames, strict=True))


def test_the_compiled_form_is_used_and_repeats_itself():
    prepare = Preparation(augmenter(np.random.default_rng(0), Augmentation(), 1, 4, 3))
    assert prepare._compiled.get() is not None
    batch = a_batch(np.random.default_rng(1), 64, (16, 20, 3), (4, 3))
    first, again, other = (prepare(batch, np.random.default_rng(seed)) for seed in (2, 2, 3))
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
    assert not np.array_equal(first.pictures, other.pictures)


@pytest.mark.parametrize("form", [lambda prepare: prepare, plainly])
def test_without_augmentation_it_standardises(form):
    settings = Augmentation(flip=0, noise=0, grey=0, shadow=0, colour=0)
    prepare = form(Preparation(Augmenter(settings, None)))
    for shape in ((16, 20, 3), (8, 8, 6)):  # and one preparation takes batches of any shape
        batch = a_batch(np.random.default_rng(1), 5, shape, (4, 3))
        found = prepare(batch, np.random.default_rng(0))
        expected = standardise(batch.pictures).permute(0, 2, 3, 1).numpy()
        np.testing.assert_allclose(found.pictures, expected, rtol=1e-5, atol=1e-5)
        np.testing.assert_array_equal(found.labels, batch.labels)


def test_the_table_of_noise_is_normal_and_long_enough():
    table = grains(15_360)
    assert (abs(table.mean()) < 0.01, table.std()) == (True, pytest.approx(1, abs=0.01))
    assert np.abs(np.corrcoef(table[:-1], table[1:])[0, 1]) < 0.01
    assert len(grains(10**6)) >= 2 * 10**6
