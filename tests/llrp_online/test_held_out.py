import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from llrp_online.held_out import HeldFrame, HeldOut

S = 10**9


def frame(number, label=1):
    picture = np.full((2, 2, 3), number % 256, np.uint8)
    return HeldFrame(number, picture, np.array([[label]], np.int8), np.array([[0.5]], np.float32))


@pytest.mark.parametrize(("share", "period"), [(0.5, 2), (0.25, 4), (0.1, 10), (0.01, 100)])
def test_blocks_are_kept_back_and_their_share_is_right(share, period):
    held = HeldOut(share, block_s=2.0, capacity=8)
    wanted = np.array([held.wants(1_700_000_000 * S + tick * S // 10) for tick in range(20 * period * 5)])
    blocks = wanted.reshape(-1, 20)
    assert (blocks.all(1) | ~blocks.any(1)).all()  # a block is kept back whole or not at all
    assert wanted.mean() == share
    assert not blocks[0].any()  # there must be something to learn from first
    np.testing.assert_array_equal(np.flatnonzero(blocks.all(1)), np.arange(period - 1, 5 * period, period))


def test_a_share_of_zero_keeps_none():
    held = HeldOut(0.0, block_s=2.0, capacity=8)
    assert not any(held.wants(t_s * S) for t_s in range(1000))
    assert held.batch() is None


def test_a_clock_that_jumps_back_goes_on_in_blocks():
    held = HeldOut(0.5, block_s=1.0, capacity=8)
    assert [held.wants(t_s * S) for t_s in (100, 101, 99, 98, 0)] == [False, True, True, False, False]


@given(st.lists(st.integers(0, 30), max_size=60), st.integers(1, 10))
def test_nothing_is_lost_and_the_newest_judge(numbers, capacity):
    held = HeldOut(0.5, block_s=1.0, capacity=capacity)
    left, came = [], []
    for number in numbers:
        came += [] if number in held else [number]
        leaving = held.put(frame(number))
        left += [] if leaving is None else [leaving.frame_id]
        assert len(held) <= capacity
    kept = [number for number in dict.fromkeys(numbers) if number in held]
    assert sorted(left + kept) == sorted(came)
    # First in, first out.
    assert left == came[: len(left)]


def test_newer_labels_take_the_place_of_older_ones():
    held = HeldOut(0.5, block_s=1.0, capacity=2)
    held.put(frame(1, label=-1))
    held.put(frame(2, label=0))
    assert held.put(frame(1, label=1)) is None
    assert held.get(1).labels.tolist() == [[1]]
    assert held.batch().labels.ravel().tolist() == [1, 0]
    # Newer labels do not make an old frame new.
    assert held.put(frame(3)).frame_id == 1


def test_a_batch_is_all_of_them():
    held = HeldOut(0.5, block_s=1.0, capacity=4)
    for number in range(6):
        held.put(frame(number))
    batch = held.batch()
    assert batch.pictures[:, 0, 0, 0].tolist() == [2, 3, 4, 5]
    assert (batch.pictures.dtype, batch.labels.dtype, batch.weight.dtype) == (np.uint8, np.int8, np.float32)
    assert batch.weight.shape == (4, 1, 1)


@pytest.mark.parametrize("count", [0, 3])
def test_state_goes_round(count):
    held, twin = HeldOut(0.5, block_s=1.0, capacity=4), HeldOut(0.5, block_s=1.0, capacity=4)
    held.wants(int(7.5 * S))
    for number in range(count):
        held.put(frame(number, label=number % 2))
    twin.put(frame(99))
    twin.restore(held.state())
    assert len(twin) == count
    assert 99 not in twin
    for number in range(count):
        for name in ("picture", "labels", "weight"):
            np.testing.assert_array_equal(getattr(twin.get(number), name), getattr(held.get(number), name))
    times = [int(t_s * S) for t_s in np.arange(8.2, 20, 0.5)]
    assert [twin.wants(t) for t in times] == [held.wants(t) for t in times]


def test_nothing_seen_is_a_state_too():
    twin = HeldOut(0.5, block_s=1.0, capacity=4)
    twin.restore(HeldOut(0.5, block_s=1.0, capacity=4).state())
    assert not twin.wants(3 * S)
    assert twin.wants(4 * S)
