import numpy as np

from llrp_online.events import OdometrySample, Picture, Reading
from llrp_online.labeller import Labeller
from tests.llrp_online.worlds import configuration, events

MS = 1_000_000
TWO_TOPICS = [
    {"name": "left", "topic": "range", "field": "ranges[1]", "below": 0.2, "swap": "right"},
    {"name": "bumper", "topic": "bumper", "field": "data", "above": 0.5, "swap": "bumper"},
    {"name": "right", "topic": "range", "field": "ranges[0]", "below": 0.2, "swap": "left"},
]


def pose(t_ms, x_m):
    return OdometrySample(t_ms * MS, np.array([x_m, 0.0, 0.0]))


def reading(t_ms, topic, bits):
    return Reading(t_ms * MS, topic, np.array(bits, np.int8))


def picture(t_ms, camera=0):
    return Picture(t_ms * MS, camera, np.zeros((16, 16, 3), np.uint8))


def closed(labeller, stream):
    found = [update for event in stream for update in labeller.take(event).updates]
    return {update.frame_id: update for update in [*found, *labeller.end_trajectory()] if update.closed}


def test_topics_are_streams_that_do_not_compete():
    labeller = Labeller(configuration(short_range=TWO_TOPICS))
    found = closed(
        labeller,
        [
            pose(0, 0.0),
            picture(0),
            # Both readings are taken where the frame was, at other times: each labels its own sensors.
            reading(0, "range", [1, -1, 0]),
            reading(10, "bumper", [-1, 1, -1]),
            pose(100, 0.01),
            # Nearest of its stream for the bumper is still the one before.
            reading(100, "bumper", [-1, 0, -1]),
        ],
    )
    assert found[0].labels.tolist() == [[1, 1, 0], [-1, -1, -1], [-1, -1, -1]]
    assert found[0].weight.tolist() == [[1, 1, 1], [0, 0, 0], [0, 0, 0]]


def test_frames_count_up_from_the_first_id():
    labeller = Labeller(configuration(), first_id=40)
    outcomes = [labeller.take(event) for event in (pose(0, 0.0), picture(0), picture(50), picture(100))]
    assert [frame.frame_id for outcome in outcomes for frame in outcome.frames] == [40, 41, 42]
    assert labeller.next_id == 43
    assert [frame.t_ns for frame in outcomes[2].frames] == [50 * MS]


def test_every_frame_closes_once_and_the_end_of_a_trajectory_closes_all():
    labeller, stream = Labeller(configuration()), events(12)
    open_ids, closed_ids = set(), []
    for event in stream:
        outcome = labeller.take(event)
        open_ids |= {frame.frame_id for frame in outcome.frames}
        closed_ids += [update.frame_id for update in outcome.updates if update.closed]
    assert 0 < labeller.store.waiting < len(open_ids)
    closed_ids += [update.frame_id for update in labeller.end_trajectory()]
    assert sorted(closed_ids) == sorted(open_ids) == list(range(120))
    assert labeller.store.waiting == 0


def test_nothing_is_matched_across_the_end_of_a_trajectory():
    labeller = Labeller(configuration())
    for event in (pose(0, 0.0), picture(0), pose(100, 0.0)):
        labeller.take(event)
    assert [(u.closed, u.posed, bool((u.labels >= 0).any())) for u in labeller.end_trajectory()] == [
        (True, True, False)
    ]
    found = closed(labeller, [pose(200, 0.0), reading(200, "range", [1, 1]), picture(200), pose(300, 0.0)])
    assert list(found) == [1]
    assert found[1].labels[0].tolist() == [1, 1]


def test_pictures_of_two_recordings_are_no_frame():
    cameras = [
        {"topic": "a", "width": 16, "height": 16, "swap": "b"},
        {"topic": "b", "width": 16, "height": 16, "swap": "a"},
    ]
    labeller = Labeller(configuration(camera=cameras))
    assert labeller.take(picture(0, camera=0)).frames == []
    labeller.end_trajectory()
    assert labeller.take(picture(10, camera=1)).frames == []
    [frame] = labeller.take(picture(20, camera=0)).frames
    assert frame.picture.shape == (16, 16, 6)
    assert frame.t_ns == 20 * MS


def test_what_could_not_be_used_is_counted():
    cameras = [{"topic": "a", "width": 16, "height": 16}, {"topic": "b", "width": 16, "height": 16}]
    labeller = Labeller(configuration(camera=cameras, augmentation={"flip": 0.0}))
    labeller.take(pose(0, float("nan")))
    for t_ms in range(0, 2000, 100):
        labeller.take(picture(t_ms, camera=0))
    assert labeller.drops["odometry: not a number"] == 1
    assert labeller.drops["camera: no picture of the other cameras near enough in time"] == 12
