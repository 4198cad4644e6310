"""The field language: what may be written, what is read, and what is said where it is not there."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents import messages
from agents.fields import read_field
from agents.intake import Intake
from agents.messages import MessageError
from llrp_online.configuration import RobotConfiguration, validate
from llrp_online.configuration.field import Field
from llrp_online.events import OdometrySample, Reading
from tests.agents.robots import bumper_event, hazards, intensities, scan


def value(message: object, text: str) -> float | None:
    return read_field(message, Field.parse(text))


@pytest.mark.parametrize(
    "text",
    [
        "",
        "latest ",
        "3",
        ".a",
        "a..b",
        "a.",
        "[0]",
        "a[-1]",
        "a[1:2]",
        "a[1deg:2]",
        "a[1deg:2deg].b",
        "[a=1]",
        "a[b=]",
        "a b",
        "latest latest a",
    ],
)
def test_what_is_no_field_is_refused(text):
    with pytest.raises(ValueError, match="expected names and indices such as"):
        Field.parse(text)


finite = st.floats(0.0625, 5.0, width=32)
odd = st.sampled_from([math.inf, math.nan, 0.0, 9.0, -math.inf])


@given(
    ranges=st.lists(finite | odd, min_size=8, max_size=80),
    begin=st.floats(-360, 360),
    span=st.floats(5, 355),
    first=st.integers(-180, 180),
    width=st.integers(0, 300),
)
def test_a_sector_has_the_least_valid_range_within_its_angles(ranges, begin, span, first, width):
    """Held against each beam's direction, asked one by one."""
    last, step = first + width, math.radians(span / (len(ranges) - 1))
    message = scan(ranges, math.radians(begin), step, (0.0625, 5.0))
    inside, unsure = [], False
    for i, r in enumerate(np.asarray(ranges, np.float32).astype(float)):
        turned = (math.degrees(message.angle_min + i * message.angle_increment) - first) % 360
        unsure |= min(abs(turned - edge) for edge in (0, width, 360)) < 0.02
        if turned <= width:
            inside.append(r)
    if unsure:
        return  # a beam on the very edge
    if not inside:
        with pytest.raises(MessageError, match="no beam in that sector"):
            value(message, f"ranges[{first}deg:{last}deg]")
        return
    known = [r for r in inside if 0.0625 <= r <= 5.0 or math.isinf(r)]
    found = value(message, f"ranges[{first}deg:{last}deg]")
    assert math.isnan(found) if not known else found == min(known)


def test_a_scan_that_begins_ahead_and_goes_round_has_a_sector_ahead():
    ranges = np.full(360, 3.0, np.float32)
    ranges[[2, 358, 90]] = 0.5, 0.4, 0.1
    message = scan(ranges, 0.0, math.radians(1), (0.12, 3.5))
    assert value(message, "ranges[-10deg:10deg]") == pytest.approx(0.4)
    assert value(message, "ranges[1deg:10deg]") == pytest.approx(0.5)
    assert value(message, "ranges[85deg:95deg]") == pytest.approx(3.0)  # 0.1 is nearer than it can measure


def test_elements_are_found_by_what_they_are_called_and_counted():
    vector = intensities(5, {"ir_intensity_left": 3, "ir_intensity_front_left": 200})
    assert value(vector, "readings[header.frame_id=ir_intensity_front_left].value") == 200
    with pytest.raises(MessageError, match=r"no element with header.frame_id = ir_right; there are ir_intensity_left,"):
        value(vector, "readings[header.frame_id=ir_right].value")
    found = hazards(5, [(1, "bump_left"), (1, "bump_front_left"), (5, "base_link")])
    assert value(found, "detections[header.frame_id=bump_left]") == 1
    assert value(found, "detections[header.frame_id=bump_right]") == 0
    assert value(found, "detections[type=1]") == 2
    assert value(hazards(5, []), "detections[type=1]") == 0
    with pytest.raises(MessageError, match="no 'typ'; there is header, type"):
        value(found, "detections[typ=1]")


def test_a_message_that_is_about_something_else_says_nothing():
    assert value(bumper_event(0, 1), "[bumper=0].state") == 1
    assert value(bumper_event(2, 1), "[bumper=0].state") is None


KOBUKI = {
    "robot": {"name": "kobuki"},
    "camera": [{"topic": "image", "width": 80, "height": 64}],
    "short_range": [
        {"name": name, "topic": "bump", "field": f"latest [bumper={i}].state", "above": 0.5}
        for i, name in enumerate(("left", "center", "right"))
    ],
    "augmentation": {"flip": 0.0},
    "targets": {"kind": "line", "start_m": 0.0, "stop_m": 1.0, "step_m": 0.1},
    "labels": {"position_tolerance_m": 0.05},
}


def test_what_an_event_said_holds_and_is_said_again_with_every_pose():
    intake = Intake(validate(KOBUKI, RobotConfiguration, "kobuki"))
    kind = "kobuki_ros_interfaces/msg/BumperEvent"

    def pose(t_ns: int) -> list[Reading]:
        data = messages.encode(messages.odometry(OdometrySample(t_ns, np.zeros(3))))
        *readings, sample = intake.events("/odom", "nav_msgs/msg/Odometry", data, 0)
        assert isinstance(sample, OdometrySample)
        assert all(isinstance(reading, Reading) and reading.t_ns == sample.t_ns for reading in readings)
        return readings

    def event(bumper: int, state: int) -> None:
        assert intake.events("/bump", kind, messages.encode(bumper_event(bumper, state)), 0) == []

    assert pose(1) == []  # nothing was ever said
    event(1, 1)
    assert [reading.bits.tolist() for reading in pose(2)] == [[-1, 1, -1]]
    assert [reading.bits.tolist() for reading in pose(3)] == [[-1, 1, -1]]
    event(0, 0)
    event(1, 0)
    first = pose(4)
    event(2, 1)
    assert [reading.bits.tolist() for reading in first + pose(5)] == [[0, 0, -1], [0, 0, 1]]
    assert intake.latest.tolist() == [0, 0, 1]
    assert not intake.drops


def test_a_topic_holds_for_all_of_its_sensors_or_for_none():
    mixed = {**KOBUKI, "short_range": [*KOBUKI["short_range"][:2], {**KOBUKI["short_range"][2], "field": "state"}]}
    with pytest.raises(ValueError, match="of topic 'bump', either every field is `latest` or none is"):
        validate(mixed, RobotConfiguration, "kobuki")


def test_a_range_of_a_ros_that_knew_no_variance_is_read():
    data = bytes.fromhex("00010000 05000000 06000000 02000000 78000000 0000803f cdcccc3d 00008040 0000003f")
    assert value(messages.decode("sensor_msgs/msg/Range", data), "range") == 0.5
    with pytest.raises(MessageError, match="not a sensor_msgs/msg/Range"):
        messages.decode("sensor_msgs/msg/Range", data[:-5])
