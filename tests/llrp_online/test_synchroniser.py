import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from llrp_online.events import Picture
from llrp_online.synchroniser import Synchroniser

MS = 1_000_000


def picture(t_ms, camera=0, value=None):
    return Picture(t_ms * MS, camera, np.full((2, 3, 3), camera if value is None else value, np.uint8))


def frames(sync, pictures):
    """(time in ms, value of each camera's picture) of every frame, in the order they came out."""
    found = [frame for one in pictures for frame in sync.add(one)]
    for frame in found:
        assert frame.picture.shape[:2] == (2, 3)
    return [(frame.t_ns // MS, frame.picture[0, 0, ::3].tolist()) for frame in found]


def test_with_one_camera_every_picture_is_a_frame_at_once():
    sync = Synchroniser(cameras=1, tolerance_s=0.01)
    assert frames(sync, [picture(0, value=1), picture(5, value=2), picture(3, value=3)]) == [
        (0, [1]),
        (5, [2]),
        (3, [3]),
    ]
    assert sync.unmatched == 0


def test_channels_are_in_the_order_of_the_cameras_and_the_time_is_the_firsts():
    sync = Synchroniser(cameras=3, tolerance_s=0.02)
    assert frames(sync, [picture(10, 2), picture(0, 0), picture(5, 1)]) == [(0, [0, 1, 2])]


def test_pictures_too_far_apart_are_no_frame():
    sync = Synchroniser(cameras=2, tolerance_s=0.02)
    assert frames(sync, [picture(0, 0), picture(21, 1)]) == []
    assert frames(sync, [picture(41, 0, value=7)]) == [(41, [7, 1])]


def test_the_nearest_partner_is_taken_and_used_once():
    sync = Synchroniser(cameras=2, tolerance_s=0.02)
    early, near = picture(0, 1, value=1), picture(15, 1, value=2)
    assert frames(sync, [early, near, picture(14, 0, value=9)]) == [(14, [9, 2])]
    assert frames(sync, [picture(16, 0, value=8)]) == [(16, [8, 1])]


def test_a_silent_camera_costs_frames_but_no_memory():
    sync = Synchroniser(cameras=2, tolerance_s=0.02)
    assert frames(sync, [picture(100 * i, 0) for i in range(1000)]) == []
    assert 980 <= sync.unmatched < 1000
    # Once it speaks again, frames come again.
    assert frames(sync, [picture(100_000, 1), picture(100_000, 0)]) == [(100_000, [0, 1])]


@given(st.lists(st.tuples(st.integers(0, 1), st.integers(0, 300)), max_size=40))
def test_no_picture_is_used_twice_and_all_of_a_frame_are_near(arrivals):
    sync = Synchroniser(cameras=2, tolerance_s=0.02)
    found = []
    for value, (camera, t_ms) in enumerate(arrivals):
        found += frames(sync, [picture(t_ms, camera, value=value)])
    used = [value for _, values in found for value in values]
    assert len(used) == len(set(used))
    for t_ms, values in found:
        assert [arrivals[value][0] for value in values] == [0, 1]
        assert arrivals[values[0]][1] == t_ms
        assert abs(arrivals[values[1]][1] - t_ms) <= 20
