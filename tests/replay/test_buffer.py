"""The replay buffer: its budget, its policies, updates in place, and the exact way back from disk."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from replay import frame_store
from replay.buffer import BufferSettings, ReplayBuffer, warn_if_too_large

SHAPE, LABELS = (8, 8, 3), (3, 2)


def make(**keys):
    frames = keys.pop("frames", 40)
    probe = ReplayBuffer(SHAPE, LABELS, BufferSettings(budget_bytes=10**6, recent_frames=8))
    keys = {"recent_frames": 8, "duplicate_distance": 0.0, **keys}
    return ReplayBuffer(SHAPE, LABELS, BufferSettings(budget_bytes=frames * probe.frame_bytes, **keys))


def frame(rng, positive=0.1):
    picture = rng.integers(0, 255, SHAPE, np.uint8)
    labels = np.where(rng.random(LABELS) < 0.3, -1, rng.random(LABELS) < positive).astype(np.int8)
    return picture, labels, (labels >= 0).astype(np.float32)


def frames(buffer):
    """All that is kept, in the order of the state's ids: pictures, labels, weight."""
    shards = list(buffer.shards())
    return {name: np.concatenate([shard[name] for shard in shards]) for name in shards[0]}


def fill(buffer, count, seed=0, **keys):
    rng = np.random.default_rng(seed)
    for i in range(count):
        buffer.add(i, *frame(rng, **keys))
    return rng


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 1000), st.sampled_from(["balanced", "reservoir", "fifo"]), st.integers(1, 200))
def test_counts_and_bounds_hold_for_any_history(seed, policy, count):
    buffer = make(policy=policy, seed=seed)
    rng = np.random.default_rng(seed)
    for i in range(count):
        buffer.add(i, *frame(rng))
        if rng.random() < 0.5:
            _, labels, weight = frame(rng)
            buffer.update(int(rng.integers(0, i + 1)), labels, weight)
    state = buffer.state()
    assert len(buffer) == len(state["ids"]) == min(count, buffer.capacity)
    assert len(set(state["ids"].tolist())) == len(buffer)
    wanted = np.stack([(frames(buffer)["labels"] == c).sum(0) for c in (0, 1)], -1)
    np.testing.assert_array_equal(buffer.class_counts, wanted)
    newest = set(range(max(count - 8, 0), count))
    assert newest <= set(state["ids"].tolist()), "a recent frame was lost"


def test_update_in_place_is_what_comes_out():
    buffer = make()
    fill(buffer, 1)
    labels = np.array([[1, -1], [0, 0], [-1, 1]], np.int8)
    assert buffer.update(0, labels, np.full(LABELS, 0.5, np.float32))
    batch = buffer.sample(4)
    np.testing.assert_array_equal(batch.labels, np.broadcast_to(labels, (4, *LABELS)))
    assert (batch.weight == 0.5).all()
    assert not buffer.update(99, labels, np.zeros(LABELS, np.float32))


def test_a_batch_is_half_recent_and_half_memory():
    buffer = make(frames=100, recent_frames=10)
    fill(buffer, 60)
    pictures = {p.tobytes(): i for p, i in zip(frames(buffer)["pictures"], buffer.state()["ids"], strict=True)}
    ids = np.array([pictures[p.tobytes()] for p in buffer.sample(200).pictures])
    assert (ids >= 50).sum() == 100


def test_no_frame_is_used_more_often_than_the_cap():
    buffer = make(max_uses=5)
    fill(buffer, 20)
    while buffer.sample(4) is not None:
        pass
    uses = buffer.state()["uses"]
    # Draws are with replacement within one batch, so the last batch may overshoot by at most its size.
    assert uses.min() >= 5
    assert uses.max() < 5 + 4


def test_balanced_memory_keeps_rare_positives_that_a_reservoir_loses():
    shares = {}
    for policy in ("balanced", "reservoir"):
        buffer = make(frames=108, policy=policy)
        fill(buffer, 3000, seed=1, positive=0.01)
        counts = buffer.class_counts
        shares[policy] = counts[..., 1].sum() / counts.sum()
    assert shares["balanced"] > 5 * shares["reservoir"]


def test_a_reservoir_keeps_every_age_alike_and_fifo_the_newest():
    kept = {}
    for policy in ("reservoir", "fifo"):
        ids = []
        for seed in range(30):
            buffer = make(frames=58, policy=policy, seed=seed)
            fill(buffer, 500, seed=seed)
            ids += buffer.state()["ids"][8:].tolist()
        kept[policy] = np.array(ids)
    assert kept["fifo"].min() == 500 - 58
    assert np.mean(kept["reservoir"]) == pytest.approx(245, abs=15)  # 1,500 draws from 0 to 491: sigma of the mean 3.7


def test_near_duplicates_do_not_enter_memory():
    buffer = make(duplicate_distance=2.0)
    picture, labels = np.full(SHAPE, 100, np.uint8), np.zeros(LABELS, np.int8)
    for i in range(30):
        buffer.add(i, picture + np.uint8(i % 2), labels, np.ones(LABELS, np.float32))
    assert buffer.sizes == {"recent": 8, "memory": 1}
    assert buffer.duplicates == 21
    buffer.add(100, picture, np.ones(LABELS, np.int8), np.ones(LABELS, np.float32))
    for i in range(101, 110):
        buffer.add(i, picture, labels, np.ones(LABELS, np.float32))
    assert 100 in buffer, "the same picture with another label is no repetition"


@pytest.mark.parametrize("policy", ["balanced", "reservoir", "fifo"])
def test_restored_exactly(policy):
    settings_ = {"frames": 50, "seed": 4, "duplicate_distance": 30.0, "policy": policy, "max_uses": 40}
    first = make(**settings_)
    rng = fill(first, 200, seed=2)
    while len(first.sample(16)) and (first.state()["uses"] < 40).all():  # until some are used up
        pass
    second = make(**settings_)
    fill(second, 30, seed=9)
    second.restore(first.state(), first.shards(), first.random_state())
    tail = [frame(rng) for _ in range(60)]
    for i, (picture, labels, weight) in enumerate(tail):
        drawn = []
        for buffer in (first, second):
            buffer.add(1000 + i, picture, labels, weight)
            buffer.update(1000 + i // 2, labels, weight)
            drawn.append(buffer.sample(16))
        np.testing.assert_array_equal(drawn[0].pictures, drawn[1].pictures)
        np.testing.assert_array_equal(drawn[0].labels, drawn[1].labels)
    for name, array in first.state().items():
        np.testing.assert_array_equal(array, second.state()[name], err_msg=name)
    np.testing.assert_array_equal(first.class_counts, second.class_counts)
    assert first.duplicates == second.duplicates


def test_uses_forgiven_and_a_cap_raised_are_drawn_again():
    tired = make(max_uses=2)
    fill(tired, 30)
    while tired.sample(8) is not None:
        pass
    forgiven, raised = make(max_uses=2), make(max_uses=50)
    state = tired.state()
    raised.restore(state, tired.shards(), tired.random_state())
    state["uses"][:] = 0
    forgiven.restore(state, tired.shards(), tired.random_state())
    for buffer in (forgiven, raised):
        assert len({picture.tobytes() for picture in buffer.sample(400).pictures}) == 30


def test_frames_are_saved_in_parts_that_make_a_whole(monkeypatch):
    monkeypatch.setattr(frame_store, "_SHARD_BYTES", 1000)
    buffer, other = make(), make()
    fill(buffer, 35)
    shards = list(buffer.shards())
    assert len(shards) > 5
    assert sum(len(shard["pictures"]) for shard in shards) == 35
    other.restore(buffer.state(), shards, buffer.random_state())
    for name, array in frames(buffer).items():
        np.testing.assert_array_equal(array, frames(other)[name])
    with pytest.raises(ValueError, match=r"expected 35 saved frames, found"):
        other.restore(buffer.state(), shards[:-1], buffer.random_state())
    with pytest.raises(ValueError, match=r"saved pictures are \(4, 4, 3\), expected \(8, 8, 3\)"):
        other.restore(buffer.state(), [{**shards[0], "pictures": np.zeros((1, 4, 4, 3))}], buffer.random_state())


def test_many_updates_at_once_are_as_many_one_by_one():
    one_by_one, at_once = make(frames=30), make(frames=30)
    rng = fill(one_by_one, 50)
    fill(at_once, 50)
    for _ in range(20):
        ids = rng.integers(0, 60, 12).tolist()
        _, labels, weight = zip(*(frame(rng) for _ in ids), strict=True)
        singly = [one_by_one.update(*update) for update in zip(ids, labels, weight, strict=True)]
        assert at_once.update_many(ids, np.stack(labels), np.stack(weight)).tolist() == singly
        assert singly == [frame_id in at_once for frame_id in ids]
    for name, array in frames(at_once).items():
        np.testing.assert_array_equal(array, frames(one_by_one)[name])
    np.testing.assert_array_equal(at_once.class_counts, one_by_one.class_counts)


def test_repetitions_of_the_newest_are_found_in_a_full_memory():
    buffer = make(frames=40, duplicate_distance=2.0)
    rng = fill(buffer, 300)
    assert (len(buffer), buffer.duplicates) == (buffer.capacity, 0)
    picture, labels, weight = frame(rng, positive=1.0)  # rare, so that it stays
    for i in range(300, 340):
        buffer.add(i, picture, labels, weight)
    assert buffer.duplicates == 31


def test_a_budget_too_small_says_what_is_needed():
    with pytest.raises(ValueError, match=r"expected at least .* raise memory.budget_mb or lower memory.recent_frames"):
        ReplayBuffer((64, 80, 3), (31, 5), BufferSettings(budget_bytes=1_000_000))


def test_a_budget_larger_than_the_machine_warns(caplog):
    warn_if_too_large(1 << 50)
    assert "lower memory.budget_mb" in caplog.text


def test_the_same_frame_twice_is_an_error():
    buffer = make()
    fill(buffer, 1)
    with pytest.raises(ValueError, match="frame 0 is here already"):
        fill(buffer, 1)
