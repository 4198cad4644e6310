"""The drift window: covariance between two moments, the probability that goes with it, and the store under both."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from replay.poses import compose, relative
from replay.rule import LabelRule, OdometryLimits
from replay.targets import Targets
from replay.track import Track
from replay.trajectory import TrajectoryStore
from replay.uncertainty import axes, relative_covariance, within_angle, within_disc
from tests.replay import brute
from tests.replay.test_trajectory import Ledger, compare, expected, feed
from tests.replay.worlds import drive, mail

HEADING_DEVIATION, POSITION_DEVIATION = 0.005, 0.002  # a step


def steady_noise(x_m, y_m, turn_rad):
    """The same noise every step, whatever it does."""
    return HEADING_DEVIATION**2, POSITION_DEVIATION**2, 0.0, POSITION_DEVIATION**2


@pytest.fixture(scope="module")
def noisy_runs():
    """A curved path there and back, its odometry, and 1,500 noisy true runs that share that odometry."""
    rng = np.random.default_rng(0)
    steps = np.zeros((120, 3))
    steps[:60, 0], steps[60:, 0] = 0.05, -0.05
    steps[:, 2] = 0.05 * np.sin(np.arange(120) / 7)
    noise = rng.normal(size=(1500, 120, 3)) * [POSITION_DEVIATION, POSITION_DEVIATION, HEADING_DEVIATION]
    nominal, true = [np.zeros(3)], [np.zeros((1500, 3))]
    for i, step in enumerate(steps):
        nominal.append(compose(nominal[-1], step))
        true.append(compose(true[-1], step + noise[:, i]))
    return np.array(nominal), np.stack(true, 1)


@pytest.mark.parametrize(("a", "b"), [(0, 30), (0, 60), (20, 110), (60, 10), (119, 3), (50, 70)])
def test_covariance_equals_that_of_simulated_runs(noisy_runs, a, b):
    nominal, true = noisy_runs
    track = Track(OdometryLimits(1.0, 100.0), steady_noise)
    for i, pose in enumerate(nominal):
        track.add(i * 50_000_000, pose.tolist())
    sums = track.live.sums
    covariance, heading = relative_covariance(sums[a : a + 1], sums[b : b + 1], nominal[b : b + 1, :2])
    seen = relative(true[:, a], true[:, b])
    turn = nominal[a, 2]
    world = seen[:, :2] @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    real = np.cov(world.T)
    long, short, _ = axes(covariance)
    real_axes = np.sqrt(np.linalg.eigvalsh(real))[::-1]
    # 1,500 runs know a deviation to 1.8 %, one sigma.
    np.testing.assert_allclose([long[0], short[0]], real_axes, rtol=0.07)
    np.testing.assert_allclose(np.sqrt(heading[0]), seen[:, 2].std(), rtol=0.07)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6))
def test_probability_within_a_disc_equals_counting(seed):
    rng = np.random.default_rng(seed)
    factor = rng.normal(size=(2, 2)) * 10.0 ** rng.uniform(-2, 0.3)
    covariance, mean = factor @ factor.T, rng.normal(size=2) * 0.7
    points = mean + rng.normal(size=(40_000, 2)) @ factor.T
    counted = (np.hypot(*points.T) <= 1.0).mean()
    said = within_disc(mean[None], np.array([[covariance[0, 0], covariance[0, 1], covariance[1, 1]]]), 1.0)[0]
    assert said == pytest.approx(counted, abs=0.015)


def test_probability_at_the_ends():
    none = np.zeros((1, 3))
    assert within_disc(np.array([[0.5, 0.0]]), none, 1.0)[0] == pytest.approx(1.0)
    assert within_disc(np.array([[1.5, 0.0]]), none, 1.0)[0] == pytest.approx(0.0)
    assert within_disc(np.zeros((1, 2)), np.array([[1e6, 0.0, 1e6]]), 1.0)[0] < 1e-5
    assert within_angle(np.zeros(1), np.zeros(1), 0.1)[0] == pytest.approx(1.0)


def test_an_accumulated_covariance_gives_the_same_sums_as_its_steps():
    """A robot that publishes its filter's covariance and one whose step noise is known must agree."""
    rng = np.random.default_rng(3)
    given_track, modelled = (Track(OdometryLimits(1.0, 100.0), steady_noise) for _ in range(2))
    pose, covariance = np.zeros(3), np.zeros((3, 3))
    for i in range(50):
        given_track.add(i * 10**8, pose.tolist(), covariance)
        modelled.add(i * 10**8, pose.tolist())
        after = compose(pose, rng.normal(size=3) * [0.05, 0.0, 0.2])
        carry = np.eye(3)
        carry[0, 2], carry[1, 2] = pose[1] - after[1], after[0] - pose[0]
        step = np.diag([POSITION_DEVIATION**2, POSITION_DEVIATION**2, HEADING_DEVIATION**2])
        pose, covariance = after, carry @ covariance @ carry.T + step
    np.testing.assert_allclose(given_track.live.sums, modelled.live.sums, rtol=1e-6, atol=1e-12)


def test_a_covariance_that_stands_still_is_no_covariance():
    given_track, modelled = (Track(OdometryLimits(1.0, 100.0), steady_noise) for _ in range(2))
    for i in range(5):
        given_track.add(i * 10**8, [0.1 * i, 0.0, 0.0], np.eye(3) * 0.01)
        modelled.add(i * 10**8, [0.1 * i, 0.0, 0.0])
    np.testing.assert_array_equal(given_track.live.sums, modelled.live.sums)


def gate(events, rule, limits):
    """Is a pair within the drift gate? Summed step by step over the odometry between the two moments."""
    odometry = sorted((e for e in events if isinstance(e, brute.Odometry)), key=lambda o: o.t_ns)
    numbers = brute.trajectories(odometry, limits)

    def allowed(frame, reading):
        there = brute.locate(reading.t_ns, odometry, numbers)
        first, last = sorted((frame.t_ns, reading.t_ns))
        total = np.zeros((2, 2))
        for a, b in itertools.pairwise(odometry):
            share = max(0, min(b.t_ns, last) - max(a.t_ns, first)) / (b.t_ns - a.t_ns)
            middle = (np.array(a.pose[:2]) + np.array(b.pose[:2])) / 2
            vx, vy = np.array(there[0][:2]) - middle
            across = np.array([-vy, vx])
            total += share * (HEADING_DEVIATION**2 * np.outer(across, across) + np.eye(2) * POSITION_DEVIATION**2)
        return np.sqrt(np.linalg.eigvalsh(total)[-1]) <= rule.gate_m

    return allowed


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), late=st.booleans(), gate_m=st.sampled_from([0.0123, 0.0371]))
def test_store_equals_the_rule_under_a_drift_window(seed, late, gate_m):
    rng = np.random.default_rng(seed)
    limits = OdometryLimits(0.35, 3.0, 0.8 if late else 0.0)
    rule = LabelRule(0.12, 0.31, 60.0, "drift", gate_m)
    targets, streams = Targets.line(0.0, 0.6, 0.1), [[0, 1]]
    events = sorted((e for part in drive(rng, 4.0, streams) for e in part), key=lambda e: e.t_ns)
    if late:
        events = mail(rng, events, limits.max_delay_s)
    store, ledger = TrajectoryStore(targets, streams, rule, limits, steady_noise), Ledger()
    for event in events:
        ledger.take(feed(store, event))
    answers = expected(events, targets, streams, rule, limits, gate(events, rule, limits))
    compare(ledger, answers, streams, (len(targets), 2))
    for frame_id, labels in ledger.labels.items():
        weight = ledger.weight[frame_id]
        assert (weight[labels < 0] == 0).all()
        assert ((weight >= 0) & (weight <= 1)).all()


def test_a_weight_falls_with_the_distance_and_with_the_drift():
    targets = Targets.line(0.0, 2.0, 0.5)
    store = TrajectoryStore(
        targets, [[0]], LabelRule(0.02, None, 60.0, "drift", 1.0), OdometryLimits(1.0, 100.0), steady_noise
    )
    ledger = Ledger()
    for i in range(21):
        ledger.take(store.add_odometry(i * 10**8, np.array([0.1 * i, 0.0, 0.0])))
        if i == 0:
            ledger.take(store.add_frame(0, 0, np.zeros((1, 1, 3), np.uint8)))
        ledger.take(store.add_reading(i * 10**8, 0, np.zeros(1, np.int8)))
    weight = ledger.weight[0][:, 0]
    assert weight[0] == pytest.approx(1.0)
    assert (np.diff(weight) < 0).all()
