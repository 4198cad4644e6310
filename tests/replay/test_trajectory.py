"""The store against the rule, on random drives and in any order of arrival."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from replay.rule import LabelRule, OdometryLimits
from replay.targets import Targets
from replay.trajectory import TrajectoryStore
from tests.replay import brute
from tests.replay.worlds import drive, mail

PICTURE = np.zeros((2, 2, 3), np.uint8)
TARGETS = {
    "line": Targets.line(0.0, 0.6, 0.1),
    "grid": Targets.grid([-0.6, 0.6, 0.3], [-0.6, 0.6, 0.3]),
    "list": Targets.listed([[0.0, 0.0, 0.0], [0.3, 0.1, 0.4], [-0.2, 0.0, 3.1], [0.0, 0.0, 1.5]]),
}


class Ledger:
    """What the store has said of each frame so far."""

    def __init__(self):
        self.labels, self.weight, self.pictures, self.closed, self.posed = {}, {}, set(), set(), {}

    def take(self, updates):
        for u in updates:
            assert u.frame_id not in self.closed, "a closed frame spoke again"
            self.labels[u.frame_id], self.weight[u.frame_id] = u.labels, u.weight
            self.posed[u.frame_id] = u.posed
            if u.picture is not None:
                assert u.frame_id not in self.pictures, "a picture was handed out twice"
                self.pictures.add(u.frame_id)
            if u.closed:
                self.closed.add(u.frame_id)
            elif (u.labels >= 0).any():
                assert u.frame_id in self.pictures, "labels before their picture"


def feed(store, event):
    if isinstance(event, brute.Odometry):
        return store.add_odometry(event.t_ns, np.array(event.pose))
    if isinstance(event, brute.Reading):
        return store.add_reading(event.t_ns, event.stream, np.array(event.bits, np.int8))
    return store.add_frame(event.frame_id, event.t_ns, PICTURE)


def expected(events, targets, streams, rule, limits, allowed=None):
    odometry = [e for e in events if isinstance(e, brute.Odometry)]
    readings = [e for e in events if isinstance(e, brute.Reading)]
    frames = [e for e in events if isinstance(e, brute.Frame)]
    return {
        f.frame_id: brute.labels(f, odometry, readings, targets.poses, streams, rule, limits, allowed) for f in frames
    }


def compare(ledger, answers, streams, shape):
    for frame_id, answer in answers.items():
        said = ledger.labels.get(frame_id, np.full(shape, -1))
        assert brute.accepts(answer, said, streams), f"frame {frame_id}: said {said.tolist()}, the rule says {answer}"


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    kind=st.sampled_from(sorted(TARGETS)),
    streams=st.sampled_from([[[0, 1]], [[0], [1]], [[2, 0], [1]]]),
    heading=st.sampled_from([None, 0.31]),
    window_s=st.sampled_from([0.7, 3.0, 60.0]),
    late=st.booleans(),
    cut=st.floats(0.2, 1.0),
)
def test_store_equals_the_rule_at_every_moment(seed, kind, streams, heading, window_s, late, cut):
    rng = np.random.default_rng(seed)
    limits = OdometryLimits(max_gap_s=0.35, max_speed_m_s=3.0, max_delay_s=0.8 if late else 0.0)
    rule = LabelRule(0.12, heading, window_s)
    targets, sensors = TARGETS[kind], 1 + max(max(s) for s in streams)
    events = sorted((e for part in drive(rng, 6.0, streams) for e in part), key=lambda e: e.t_ns)
    if late:
        events = mail(rng, events, limits.max_delay_s)
    store, ledger = TrajectoryStore(targets, streams, rule, limits), Ledger()
    stop = round(cut * len(events))
    for event in events[:stop]:
        ledger.take(feed(store, event))
    shape = (len(targets), sensors)
    compare(ledger, expected(events[:stop], targets, streams, rule, limits), streams, shape)
    for event in events[stop:]:
        ledger.take(feed(store, event))
    answers = expected(events, targets, streams, rule, limits)
    compare(ledger, answers, streams, shape)
    ledger.take(store.end_trajectory())
    compare(ledger, answers, streams, shape)
    assert ledger.closed == set(answers)
    assert {i for i, posed in ledger.posed.items() if posed} == {i for i, a in answers.items() if a is not None}
    assert not store.drops
    assert store.sizes == {"frames": 0, "readings": 0, "odometry": 0, "picture_bytes": 0}


def test_a_label_may_improve_and_then_the_frame_closes():
    store = TrajectoryStore(
        Targets.line(0.0, 0.1, 0.1), [[0]], LabelRule(0.05, window_s=1.0), OdometryLimits(max_delay_s=0)
    )
    for i, x in enumerate([0.0, 0.06, 0.1, 0.1]):
        t_ns = i * 400_000_000
        closing = store.add_odometry(t_ns, np.array([x, 0.0, 0.0]))
        if i == 0:
            store.add_frame(7, t_ns, PICTURE)
        updates = store.add_reading(t_ns, 0, np.array([i % 2], np.int8))
        said = [(u.frame_id, u.labels[:, 0].tolist(), u.closed) for u in updates]
        assert said == [[(7, [0, -1], False)], [(7, [0, 1], False)], [(7, [0, 0], False)], []][i]
    assert [(u.closed, u.labels[:, 0].tolist()) for u in closing] == [(True, [0, 0])]


def test_memory_is_bounded_for_ever():
    rule, limits = LabelRule(0.05, window_s=2.0), OdometryLimits(max_delay_s=0.5)
    store, sizes = TrajectoryStore(TARGETS["line"], [[0]], rule, limits), []
    for i in range(4000):
        t_ns = i * 50_000_000
        store.add_odometry(t_ns, np.array([0.01 * i, 0.0, 0.0]))
        store.add_frame(i, t_ns, PICTURE)
        store.add_reading(t_ns, 0, np.zeros(1, np.int8))
        sizes.append(tuple(store.sizes.values()))
    assert max(sizes[400:2000]) == max(sizes[2000:]), "the rings still grow"
    assert store.waiting <= 2.5 / 0.05 + 2


def test_frames_beyond_the_budget_are_closed_early_and_counted():
    rule, limits = LabelRule(0.05, window_s=1000.0), OdometryLimits()
    store = TrajectoryStore(TARGETS["line"], [[0]], rule, limits, budget_bytes=20_000)
    closed = []
    for i in range(200):
        closed += [u.frame_id for u in store.add_frame(i, i * 50_000_000, np.zeros((8, 8, 3), np.uint8)) if u.closed]
    assert closed == list(range(len(closed)))
    assert 0 < store.waiting < 200
    assert store.drops["frame: closed before its window passed, for want of memory.store_mb"] == len(closed)


def test_a_late_message_is_dropped_and_counted():
    store = TrajectoryStore(TARGETS["line"], [[0]], LabelRule(0.05), OdometryLimits(max_delay_s=1.0))
    store.add_odometry(10**10, np.zeros(3))
    assert not len(store.add_reading(10**10 - 1_000_000_001, 0, np.zeros(1, np.int8)))
    assert store.drops == {"reading: later than max_delay_s = 1 s allows": 1}


def test_a_frame_that_comes_too_late_is_closed_at_once():
    store = TrajectoryStore(TARGETS["line"], [[0]], LabelRule(0.05), OdometryLimits(max_delay_s=1.0))
    store.add_odometry(10**10, np.zeros(3))
    [update] = store.add_frame(3, 10**9, PICTURE)
    assert (update.frame_id, update.closed, update.posed) == (3, True, False)
    assert (update.labels == -1).all()
    assert store.sizes["frames"] == store.sizes["picture_bytes"] == 0


def test_nan_odometry_is_dropped_and_counted():
    store = TrajectoryStore(TARGETS["line"], [[0]], LabelRule(0.05), OdometryLimits())
    store.add_odometry(0, np.array([0.0, np.nan, 0.0]))
    assert store.drops == {"odometry: not a number": 1}


def test_a_clock_that_jumps_back_begins_a_new_trajectory(caplog):
    store = TrajectoryStore(TARGETS["line"], [[0]], LabelRule(0.05), OdometryLimits(max_delay_s=0.5))
    for i in range(10):
        store.add_odometry(10**11 + i * 10**8, np.zeros(3))
        store.add_frame(i, 10**11 + i * 10**8, PICTURE)
    for i in range(8):
        store.add_odometry(i * 10**8, np.zeros(3))
    assert "the odometry clock jumped back by 100.5" in caplog.text
    updates = [*store.add_frame(99, 6 * 10**8, PICTURE), *store.add_reading(6 * 10**8, 0, np.ones(1, np.int8))]
    assert updates[-1].frame_id == 99
    assert updates[-1].labels[0, 0] == 1


def test_a_camera_clock_ahead_of_the_odometry_ends_no_trajectory(caplog):
    store = TrajectoryStore(TARGETS["line"], [[0]], LabelRule(0.05, window_s=3.0), OdometryLimits(max_delay_s=0.5))
    posed = set()
    for i in range(200):
        t_ns = i * 10**8
        updates = [*store.add_frame(i, t_ns + 2 * 10**9, PICTURE), *store.add_odometry(t_ns, np.zeros(3))]
        updates += store.add_reading(t_ns, 0, np.zeros(1, np.int8))
        posed |= {u.frame_id for u in updates if u.posed}
    assert len(posed) > 150
    assert not store.drops
    assert not caplog.text


def test_one_stamp_from_the_far_future_stops_nothing():
    store = TrajectoryStore(TARGETS["line"], [[0]], LabelRule(0.05, window_s=3.0), OdometryLimits(max_delay_s=0.5))
    store.add_frame(0, 4 * 10**18, PICTURE)
    labelled = 0
    for i in range(1, 100):
        updates = [*store.add_odometry(i * 10**8, np.zeros(3)), *store.add_frame(i, i * 10**8, PICTURE)]
        labelled += sum(u.posed for u in [*updates, *store.add_reading(i * 10**8, 0, np.zeros(1, np.int8))])
    assert labelled > 50


def test_memory_stays_bounded_when_odometry_stops():
    store = TrajectoryStore(TARGETS["line"], [[0]], LabelRule(0.05, window_s=2.0), OdometryLimits(max_delay_s=0.5))
    store.add_odometry(0, np.zeros(3))
    for i in range(3000):
        store.add_frame(i, i * 50_000_000, PICTURE)
        store.add_reading(i * 50_000_000, 0, np.zeros(1, np.int8))
    assert store.sizes["frames"] < 20 * 20
    assert store.sizes["readings"] < 20 * 20


def test_the_same_time_twice_is_dropped_and_counted():
    store = TrajectoryStore(TARGETS["line"], [[0]], LabelRule(0.05), OdometryLimits())
    for _ in range(2):
        store.add_odometry(0, np.zeros(3))
        store.add_reading(0, 0, np.zeros(1, np.int8))
    assert store.drops == {"odometry: its time was there already": 1, "reading: its time was there already": 1}


def test_a_drift_window_needs_the_noise_of_odometry():
    with pytest.raises(ValueError, match="noise"):
        TrajectoryStore(TARGETS["line"], [[0]], LabelRule(0.05, window="drift"), OdometryLimits())


def test_restored_in_mid_drive_it_goes_on_as_if_nothing_had_happened():
    rng = np.random.default_rng(5)
    events = sorted((e for part in drive(rng, 8.0, [[0, 1]]) for e in part), key=lambda e: e.t_ns)
    rule, limits = LabelRule(0.12, None, 2.0), OdometryLimits(0.35, 3.0, 0.5)
    first, second = (TrajectoryStore(TARGETS["grid"], [[0, 1]], rule, limits) for _ in range(2))
    half = len(events) // 2
    for event in events[:half]:
        feed(first, event)
    second.restore(first.state())
    said = []
    for store in (first, second):
        updates = [*(u for event in events[half:] for u in feed(store, event)), *store.end_trajectory()]
        said.append([(u.frame_id, u.closed, u.labels.tobytes(), u.picture is None) for u in updates])
    assert said[0] == said[1]
    assert any(u[1] for u in said[0])
