import math

import numpy as np
import pytest

from llrp_online.metrics import Score
from llrp_online.network import build
from llrp_online.scoring import Exam, mean_auc
from tests.llrp_online.worlds import configuration, picture

TARGETS = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.3, 0.4, 0], [0.0, -0.25, 0]])  # 0, 10, 50 and 25 cm away


def score(auc, n_pos, n_neg):
    arrays = [np.array(values) for values in (auc, n_pos, n_neg)]
    blank = np.full(arrays[0].shape, np.nan)
    return Score(TARGETS, ("left", "right"), arrays[0], blank, blank, arrays[1], arrays[2], float("nan"))


SCORE = score(
    [[0.9, 0.8], [0.7, 0.1], [0.2, 0.2], [0.6, math.nan]],
    [[10, 50], [10, 9], [99, 99], [10, 0]],
    [[10, 50], [99, 99], [99, 9], [10, 99]],
)


def test_the_mean_is_over_near_cells_with_enough_of_both_classes():
    assert mean_auc(SCORE, 0.25) == (pytest.approx((0.9 + 0.8 + 0.7 + 0.6) / 4), 4)
    assert mean_auc(SCORE, 0.1) == (pytest.approx((0.9 + 0.8 + 0.7) / 3), 3)
    assert mean_auc(SCORE, 0.5) == (pytest.approx((0.9 + 0.8 + 0.7 + 0.6 + 0.2) / 5), 5)


def test_fewer_may_do_and_sensors_may_be_chosen():
    assert mean_auc(SCORE, 0.1, fewest=9) == (pytest.approx((0.9 + 0.8 + 0.7 + 0.1) / 4), 4)
    assert mean_auc(SCORE, 0.25, sensors=[0]) == (pytest.approx((0.9 + 0.7 + 0.6) / 3), 3)


def test_without_a_cell_there_is_no_mean():
    mean, cells = mean_auc(SCORE, 0.5, fewest=1000)
    assert math.isnan(mean)
    assert cells == 0


@pytest.fixture(scope="module")
def exam():
    rng = np.random.default_rng(0)
    places = rng.uniform(0.0, 0.9, 40)
    labels = [np.array([[x_m > 0.4, -1], [0, x_m > 0.6], [-1, -1]], np.int8) for x_m in places]
    return Exam(configuration(), [(picture(x_m, rng), label) for x_m, label in zip(places, labels, strict=True)])


def weights(seed):
    return build("online", (16, 16, 3), (3, 2), seed).weights()


def test_an_exam_can_be_taken_again_and_again(exam):
    first, second = exam.score(weights(0)), exam.score(weights(1))
    assert first.pooled_auc != second.pooled_auc
    assert exam.score(weights(0)).as_json() == first.as_json()
    probabilities = exam.predict(weights(0))
    assert probabilities.shape == (40, 3, 2)
    assert first.sensors == ("left", "right")
    np.testing.assert_allclose(first.targets[:, 0], [0.0, 0.2, 0.4])
    both = ~np.isnan(first.auc)
    assert both.tolist() == [[True, False], [False, True], [False, False]]
    assert (first.n_pos + first.n_neg).tolist() == [[40, 0], [40, 40], [0, 0]]
    assert np.isnan(first.low).all()


def test_rounds_of_bootstrap_give_intervals(exam):
    found = exam.score(weights(0), rounds=50, seed=1)
    assert (found.low[0, 0] < found.auc[0, 0] < found.high[0, 0]) or found.auc[0, 0] in (0.0, 1.0)
    assert exam.score(weights(0), rounds=50, seed=1).as_json() == found.as_json()


def test_without_frames_there_is_no_exam():
    with pytest.raises(ValueError, match="no frame with a pose"):
        Exam(configuration(), [])
