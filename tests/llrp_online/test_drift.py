import numpy as np
import pytest

from llrp_online.drift import DriftDetector


def run(losses, **settings):
    detector = DriftDetector(losses.shape[1], **settings)
    return [event for t_ns, row in enumerate(losses) for event in detector.update(t_ns, row)]


def noisy(mean, count, seed=0):
    """Losses as they are: positive, skewed, of deviation like their mean."""
    return mean * np.random.default_rng(seed).gamma(2.0, 0.5, count)


def test_a_band_that_becomes_worse_is_reported_once_and_by_name():
    losses = np.stack([noisy(0.2, 6000, 1), np.r_[noisy(0.2, 4000, 2), noisy(0.6, 2000, 3)]], axis=1)
    (event,) = run(losses)
    assert event.band == 1
    assert 4000 < event.t_ns < 5000
    assert event.before == pytest.approx(0.2, abs=0.03)
    assert event.after == pytest.approx(0.6, abs=0.2)


def test_learning_is_no_drift():
    falling = np.concatenate([noisy(mean, 1000, seed) for seed, mean in enumerate([0.7, 0.5, 0.3, 0.2, 0.15])])
    assert run(falling[:, None]) == []


def test_a_steady_stream_raises_hardly_an_alarm():
    steady = np.stack([noisy(0.3, 20_000, seed) for seed in range(4)], axis=1)
    assert len(run(steady)) <= 1


def test_no_frame_counts_as_more_than_one_nat():
    (event,) = run(np.r_[np.full(200, 0.1), np.full(100, 16.0)][:, None], block=1)
    assert event.after == pytest.approx(1.0)


def test_frames_without_known_labels_do_not_count():
    losses = np.r_[noisy(0.2, 2000, 1), noisy(0.9, 500, 2)]
    sparse = np.full(2 * len(losses), np.nan)
    sparse[::2] = losses
    dense_events, sparse_events = run(losses[:, None]), run(sparse[:, None])
    assert [2 * event.t_ns for event in dense_events] == [event.t_ns for event in sparse_events]
    assert dense_events


def test_before_is_the_mean_of_what_was_dropped_and_after_that_of_the_newest():
    losses = np.r_[np.full(200, 0.1), np.full(100, 0.8)]
    first = run(losses[:, None], block=1)[0]
    assert first.before == pytest.approx(0.1)
    assert first.after == pytest.approx(0.8)


def test_errors_say_what_was_expected():
    with pytest.raises(ValueError, match="expected 2 bands, got 1"):
        DriftDetector(2).update(0, [0.1])
    with pytest.raises(ValueError, match="got 0"):
        DriftDetector(1, block=0)
