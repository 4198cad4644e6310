"""Online scaling of probabilities, and how they are judged."""

import numpy as np
import pytest

from llrp_online.calibration import Calibration
from llrp_online.network import build
from llrp_online.predictor import Predictor
from llrp_online.reliability import reliability

BANDS = np.array([0, 0, 1])


def sigmoid(logits):
    return 1 / (1 + np.exp(-logits))


def overconfident(seed=0, frames=4000):
    """Probabilities whose logits are twice as large as they should be, and one too high; their labels."""
    rng = np.random.default_rng(seed)
    logits = rng.normal(0, 1.5, (frames, 3, 2))
    labels = (rng.random(logits.shape) < sigmoid(logits)).astype(np.int8)
    return sigmoid(2 * logits + 1), labels


def test_a_fit_finds_what_was_done_to_the_logits():
    fit = Calibration.fit(*overconfident(), BANDS)
    np.testing.assert_allclose(fit.scale, 0.5, atol=0.05)
    np.testing.assert_allclose(fit.offset, -0.5, atol=0.08)


def test_a_fit_mends_what_it_has_not_seen_and_keeps_the_order():
    fit = Calibration.fit(*overconfident(), BANDS)
    raw, labels = overconfident(seed=1)
    mended = fit.apply(raw)
    assert reliability(raw, labels).ece > 0.1
    assert reliability(mended, labels).ece < 0.02
    assert (np.diff(mended[np.argsort(raw[:, 0, 0]), 0, 0]) >= 0).all()


def test_temperature_alone_has_no_offset():
    fit = Calibration.fit(*overconfident(), BANDS, offset=False)
    assert (fit.offset == 0).all()
    assert (fit.scale < 0.9).all()


def test_what_is_unknown_teaches_nothing():
    raw, labels = overconfident(frames=50)
    fit = Calibration.fit(raw, np.full_like(labels, -1), BANDS)
    np.testing.assert_allclose(fit.apply(raw), raw, atol=1e-6)


def test_a_few_labels_of_one_class_change_little():
    fit = Calibration.fit(np.full((1, 3, 2), 0.2), np.zeros((1, 3, 2), np.int8), BANDS)
    assert abs(float(fit.apply(np.full((1, 3, 2), 0.2))[0, 0, 0]) - 0.2) < 0.05


def test_folded_weights_predict_what_was_calibrated():
    weights = build("online", (64, 80, 3), (3, 2)).weights()
    fit = Calibration(np.array([0.5, 0.7, 2.0]), np.array([-0.3, 0.0, 0.4]))
    picture = np.random.default_rng(0).integers(0, 256, (64, 80, 3), np.uint8)
    predictor = Predictor("online", (64, 80, 3), (3, 2))
    predictor.load(weights, version=1)
    expected = fit.apply(predictor.predict(picture).probabilities[None])[0]
    predictor.load(fit.fold(weights), version=2)
    np.testing.assert_allclose(predictor.predict(picture).probabilities, expected, atol=1e-5)


def test_it_survives_json():
    fit = Calibration.fit(*overconfident(frames=50), BANDS)
    again = Calibration.of_json(fit.as_json())
    np.testing.assert_array_equal(again.scale, fit.scale)
    np.testing.assert_array_equal(again.offset, fit.offset)


def test_shapes_that_do_not_fit_are_named():
    with pytest.raises(ValueError, match="bands"):
        Calibration.fit(np.zeros((1, 2, 2)), np.zeros((1, 2, 2), np.int8), BANDS)
    with pytest.raises(ValueError, match="shapes"):
        reliability(np.zeros(2), np.zeros(3, np.int8))


def test_without_a_known_label_nothing_is_defined():
    found = reliability(np.array([0.5]), np.array([-1]))
    assert np.isnan(found.ece)
    assert np.isnan(found.brier)
