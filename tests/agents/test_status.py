"""What agents say of themselves, over the wire and back."""

from dataclasses import asdict, replace

import pytest

from agents import messages, status
from agents.messages import MessageError
from agents.status import PerceiverStatus, RobotStatus
from llrp_online.prequential import Band
from llrp_online.status import LearnerStatus, whole_minutes

LEARNER = LearnerStatus(
    robot_s=61.5,
    frames=600,
    waiting=300,
    labelled=500,
    known=[5, 0],
    positives=[1, 0],
    remembered=400,
    steps=120,
    let_go=0.5,
    loss=0.25,
    version=3,
    version_age_s=1.5,
    rejected=1,
    bands=[Band(0.0, 0.07, 0.8, 10, 90, 0.3), Band(0.08, 0.15, None, 0, 7, None)],
    drift_events=2,
    drops={'reading: "odd" [characters], ü': 3},
    paused=True,
    sizes={"frames": 300, "picture_bytes": 12_345_678_901},
    backlog=17,
)
UNBORN = replace(LEARNER, loss=None, version=None, version_age_s=None, bands=[], drops={}, paused=False, sizes={})


@pytest.mark.parametrize("said", [LEARNER, UNBORN])
def test_a_learners_status_comes_back_as_it_was(said):
    assert status.decode_learner(status.encode_learner(said, 5)) == said


def test_it_is_a_diagnostic_array_with_a_name_and_a_time():
    message = messages.decode("diagnostic_msgs/msg/DiagnosticArray", status.encode_learner(LEARNER, 1_500_000_000))
    assert messages.time_ns(message.header) == 1_500_000_000
    assert [part.name for part in message.status] == ["learner"]


def test_the_others_come_back_too():
    perceiver = PerceiverStatus(7, 9.5, 1.0, 2.0, 3.0, None, {"weights: refused": 2})
    assert PerceiverStatus(**status.decode(status.encode("perceiver", 0, asdict(perceiver)))) == perceiver
    robot = RobotStatus(12.5, 3, 1.25)
    assert RobotStatus(**status.decode(status.encode("robot", 0, asdict(robot)))) == robot


def test_rubbish_is_no_status():
    with pytest.raises(MessageError):
        status.decode(b"rubbish")


@pytest.mark.parametrize(("seconds", "minutes"), [(0.0, 0), (59.0, 0), (59.95, 1), (60.0, 1), (119.0, 1), (600.0, 10)])
def test_the_last_tick_of_a_minute_counts(seconds, minutes):
    assert whole_minutes(seconds) == minutes
