"""The compiled label rule gives what the reference gives: the same labels and pictures, at every moment."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from replay.compiling import Compiled, plainly
from replay.resolution import Drive, resolve
from replay.rule import LabelRule, OdometryLimits
from replay.targets import Targets
from replay.trajectory import TrajectoryStore
from replay.uncertainty import within_disc
from tests.replay import brute
from tests.replay.test_trajectory import TARGETS, feed
from tests.replay.test_uncertainty import steady_noise
from tests.replay.worlds import drive, mail

STREAMS = [[[0, 1]], [[0], [1]], [[2, 0], [1]]]
rules = st.builds(
    LabelRule,
    position_tolerance_m=st.sampled_from([0.02, 0.12, 0.5]),
    heading_tolerance_rad=st.sampled_from([None, 0.31]),
    window_s=st.sampled_from([0.7, 3.0, 60.0]),
    window=st.sampled_from(["fixed", "drift"]),
    gate_m=st.sampled_from([0.0123, 0.0371, 1.0]),
)


def test_the_kernels_are_there():
    assert Compiled("replay.label_kernels").get() is not None


def equal(ours, theirs):
    """The same frames, times, labels, flags and pictures; weights to rounding."""
    for name in ("frame_ids", "t_ns", "labels", "closed", "posed"):
        np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name), name)
    np.testing.assert_allclose(ours.weight, theirs.weight, atol=1e-6)
    assert ours.pictures.keys() == theirs.pictures.keys()


def events_of(seed, streams, seconds, delay_s):
    rng = np.random.default_rng(seed)
    events = sorted((e for part in drive(rng, seconds, streams) for e in part), key=lambda e: e.t_ns)
    return mail(rng, events, delay_s) if delay_s else events


@settings(max_examples=60)
@given(
    st.integers(0, 10**6), st.sampled_from(sorted(TARGETS)), st.sampled_from(STREAMS), rules, st.sampled_from([0, 0.8])
)
def test_every_update_is_equal(seed, kind, streams, rule, delay_s):
    limits = OdometryLimits(0.35, 3.0, delay_s)
    ours, theirs = (TrajectoryStore(TARGETS[kind], streams, rule, limits, steady_noise) for _ in range(2))
    for event in events_of(seed, streams, 4.0, delay_s):
        said = feed(ours, event)
        with plainly():
            equal(said, feed(theirs, event))
    said = ours.end_trajectory()
    with plainly():
        equal(said, theirs.end_trajectory())


@settings(max_examples=20)
@given(st.integers(0, 10**6), rules)
def test_either_may_take_over_between_two_messages(seed, rule):
    limits = OdometryLimits(0.35, 3.0, 0.8)
    mixed, ours = (TrajectoryStore(TARGETS["line"], [[0]], rule, limits, steady_noise) for _ in range(2))
    random = np.random.default_rng(seed)
    for event in events_of(seed, [[0]], 3.0, 0.8):
        said = feed(ours, event)
        if random.random() < 0.5:
            equal(feed(mixed, event), said)
        else:
            with plainly():
                equal(feed(mixed, event), said)


@settings(max_examples=20)
@given(st.integers(0, 10**6), st.sampled_from(STREAMS), rules)
def test_who_asks_for_closed_frames_alone_gets_their_last_labels(seed, streams, rule):
    limits = OdometryLimits(0.35, 3.0, 0.8)
    last, closed = {}, {}
    every = TrajectoryStore(TARGETS["line"], streams, rule, limits, steady_noise)
    some = TrajectoryStore(TARGETS["line"], streams, rule, limits, steady_noise, only_closed=True)
    for event in events_of(seed, streams, 4.0, 0.8):
        last |= {u.frame_id: u for u in feed(every, event)}
        updates = feed(some, event)
        assert updates.closed.all()
        closed |= {u.frame_id: u for u in updates}
    last |= {u.frame_id: u for u in every.end_trajectory()}
    closed |= {u.frame_id: u for u in some.end_trajectory()}
    assert last.keys() == closed.keys()
    for frame_id, update in closed.items():
        np.testing.assert_array_equal(update.labels, last[frame_id].labels)
        np.testing.assert_array_equal(update.weight, last[frame_id].weight)


@settings(max_examples=20)
@given(st.integers(0, 10**6), st.sampled_from(sorted(TARGETS)), rules, st.booleans())
def test_a_whole_drive_at_once_is_labelled_as_one_that_streams(seed, kind, rule, compiled):
    streams, limits = [[0, 1]], OdometryLimits(0.35, 3.0, 0.8)
    events = events_of(seed, streams, 4.0, 0)
    odometry = [e for e in events if isinstance(e, brute.Odometry)]
    readings = [e for e in events if isinstance(e, brute.Reading)]
    frames = [e for e in events if isinstance(e, brute.Frame)]
    whole = Drive(
        np.array([e.t_ns for e in odometry]),
        np.array([e.pose for e in odometry]),
        None,
        np.array([e.t_ns for e in readings]),
        np.zeros(len(readings), np.int64),
        np.array([e.bits for e in readings], np.int8),
        np.array([e.t_ns for e in frames]),
    )
    store, last = TrajectoryStore(TARGETS[kind], streams, rule, limits, steady_noise), {}
    for event in events:
        last |= {u.frame_id: u for u in feed(store, event)}
    last |= {u.frame_id: u for u in store.end_trajectory()}
    if compiled:
        found = resolve(whole, TARGETS[kind], streams, rule, limits, steady_noise)
    else:
        with plainly():
            found = resolve(whole, TARGETS[kind], streams, rule, limits, steady_noise)
    for row, frame in enumerate(frames):
        np.testing.assert_array_equal(found.labels[row], last[frame.frame_id].labels)
        np.testing.assert_allclose(found.weight[row], last[frame.frame_id].weight, atol=1e-6)
        assert found.posed[row] == last[frame.frame_id].posed


def test_kernels_are_the_same_bits_each_time():
    rule, limits = LabelRule(0.12, 0.31, 60.0, "drift", 1.0), OdometryLimits(0.35, 3.0, 0.8)
    said = []
    for _ in range(2):
        store = TrajectoryStore(TARGETS["grid"], [[0, 1]], rule, limits, steady_noise)
        updates = [feed(store, event) for event in events_of(7, [[0, 1]], 4.0, 0.8)]
        said.append(b"".join(u.labels.tobytes() + u.weight.tobytes() for u in updates))
    assert said[0] == said[1]


@pytest.mark.parametrize("radius", [0.01, 0.3])
def test_probability_within_a_disc_needs_no_finer_grid(radius):
    """Against 200 nodes in each direction, for ellipses from a point to far wider than the disc."""
    random = np.random.default_rng(0)
    nodes, weights = np.polynomial.legendre.leggauss(200)
    for _ in range(200):
        deviation = radius * 10.0 ** random.uniform(-1.0, 1.0, 2)
        offset = radius * random.uniform(-1.0, 1.0, 2)
        covariance = np.array([[deviation[0] ** 2, 0.0, deviation[1] ** 2]])
        edge = np.pi / 2 * nodes
        across, chord = radius * np.sin(edge), radius * np.cos(edge)
        along = chord[:, None] * nodes
        density = np.exp(-0.5 * ((along - offset[0]) / deviation[0]) ** 2) * np.exp(
            -0.5 * ((across[:, None] - offset[1]) / deviation[1]) ** 2
        )
        inner = (density @ weights) * chord
        exact = np.pi / 2 * ((inner * chord) @ weights) / (2 * np.pi * deviation.prod())
        assert within_disc(offset[None], covariance, radius)[0] == pytest.approx(exact, abs=1e-3)


def test_targets_far_apart_have_a_small_hash():
    store = TrajectoryStore(Targets.listed([[0, 0, 0], [900.0, -900.0, 0]]), [[0]], LabelRule(0.01), OdometryLimits())
    store.add_odometry(0, np.zeros(3))
    store.add_frame(0, 0, np.zeros((1, 1, 3), np.uint8))
    [update] = store.add_reading(0, 0, np.ones(1, np.int8))
    assert update.labels[:, 0].tolist() == [1, -1]
