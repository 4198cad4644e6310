import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.typesys.stores.ros2_jazzy import sensor_msgs__msg__Range as Range
from rosbags.typesys.stores.ros2_jazzy import std_msgs__msg__Bool as Bool

from agents import messages
from agents.intake import Intake
from llrp_online.configuration import RobotConfiguration, load, validate
from llrp_online.events import OdometrySample, Picture, Reading
from replay.recording import read

ROOT = Path(__file__).parents[2]
DATA = ROOT.parent / "shared" / "data"
needs_data = pytest.mark.skipif(not DATA.exists(), reason=f"the real recordings are not at {DATA}")
CAMERA = "camera/image/compressed"


def intake(*sensors: dict, **tables) -> Intake:
    """A small robot; by default one sensor, `ranges[0]` below 1."""
    raw = {
        "robot": {"name": "bot"},
        "camera": [{"topic": CAMERA, "width": 20, "height": 16}],
        "short_range": [
            {"name": f"s{i}", "field": "ranges[0]", **sensor} for i, sensor in enumerate(sensors or ({"below": 1.0},))
        ],
        "targets": {"kind": "line", "start_m": 0.0, "stop_m": 1.0, "step_m": 0.5},
        "labels": {"position_tolerance_m": 0.1},
        "augmentation": {"flip": 0.0},
        **tables,
    }
    return Intake(validate(raw, RobotConfiguration, "test"))


def give(taker: Intake, topic: str, message, received_ns: int = 0):
    return taker.events(topic, message.__msgtype__, messages.encode(message), received_ns)


def scan(*ranges: float, t_ns: int = 5):
    return messages.laser_scan(t_ns, ranges, (0.0, 0.1), (0.0, 4.0))


@given(value=st.floats(width=32), limit=st.floats(-1e6, 1e6, width=32), above=st.booleans())
def test_a_bit_is_what_the_threshold_says(value, limit, above):
    [reading] = give(intake({"above" if above else "below": limit}), "range", scan(value))
    expected = -1 if math.isnan(value) else int(value > limit if above else value < limit)
    assert reading.bits.tolist() == [expected]


@pytest.mark.parametrize(
    ("value", "below", "above"), [(math.inf, 0, 1), (-math.inf, 1, 0), (math.nan, -1, -1), (1.0, 0, 0)]
)
def test_far_near_and_unknown(value, below, above):
    [reading] = give(intake({"below": 1.0}, {"above": 1.0}), "range", scan(value))
    assert reading.bits.tolist() == [below, above]
    assert reading.bits.dtype == np.int8


def test_sensors_of_other_topics_are_unknown_and_topics_are_the_configuration_s():
    taker = intake({"below": 1.0}, {"topic": "/bot/bump", "field": "data", "above": 0.5})
    [reading] = give(taker, "/bot/range", scan(0.5))
    assert (reading.t_ns, reading.topic, reading.bits.tolist()) == (5, "range", [1, -1])
    [reading] = give(taker, "bump", Bool(True), received_ns=77)
    assert (reading.t_ns, reading.topic, reading.bits.tolist()) == (77, "/bot/bump", [-1, 1])


@pytest.mark.parametrize("topic", ["range", "/range", "bot/range", "/bot/range"])
def test_a_slash_and_the_robot_s_name_do_not_matter(topic):
    assert isinstance(give(intake(), topic, scan(0.5))[0], Reading)


@pytest.mark.parametrize("topic", ["other/range", "range2", "/bot2/range", ""])
def test_other_topics_say_nothing(topic):
    taker = intake()
    assert give(taker, topic, scan(0.5)) == []
    assert not taker.drops


def test_one_topic_may_be_several_things():
    taker = intake({"topic": "odom", "field": "pose.pose.position.x", "above": 0.5})
    events = give(taker, "odom", messages.odometry(OdometrySample(9, np.array([1.0, 2.0, 0.5]))))
    assert [type(event) for event in events] == [OdometrySample, Reading]
    assert events[1].bits.tolist() == [1]
    assert events[0].covariance is None


def test_a_field_that_is_not_there_is_counted_and_said(caplog):
    taker = intake({"field": "ranges[3]", "below": 1.0}, {"below": 1.0})
    for _ in range(100):
        [reading] = give(taker, "range", scan(0.5, 0.5))
    assert reading.bits.tolist() == [-1, 1]
    assert taker.drops == {"range: no `ranges[3]` in a sensor_msgs/msg/LaserScan": 100}
    logged = [record.getMessage() for record in caplog.records]
    assert [line.rsplit("(")[-1] for line in logged] == ["1 so far)", "10 so far)", "100 so far)"]
    assert "no element 3; there are 2" in logged[0]


@pytest.mark.parametrize(
    ("field", "says"),
    [
        ("rages[0]", "no 'rages'; there is header, angle_min"),
        ("angle_min[0]", "'0' of a float, which is no list"),
        ("ranges", "expected a number, got ndarray"),
        ("header.frame_id", "expected a number, got str"),
        ("angle_min.x", "no 'x'; there is float"),
    ],
)
def test_a_field_that_is_no_number_says_what_there_is(field, says, caplog):
    assert give(intake({"field": field, "below": 1.0}), "range", scan(0.5)) == []
    assert says in caplog.text


def test_a_single_range_message():
    message = Range(messages.header(5, "base_link"), Range.INFRARED, 0.1, 0.0, 4.0, 0.25, 0.0)
    [reading] = give(intake({"field": "range", "below": 0.5}), "range", message)
    assert reading.bits.tolist() == [1]


def test_pictures_are_resized_rgb():
    red = np.zeros((32, 40, 3), np.uint8)
    red[:, :20, 0] = 200
    for message in (messages.compressed_image(7, red, "png"), messages.image(7, red)):
        [picture] = give(intake(), CAMERA, message)
        assert isinstance(picture, Picture)
        assert (picture.t_ns, picture.camera, picture.pixels.shape) == (7, 0, (16, 20, 3))
        assert picture.pixels.dtype == np.uint8
        assert picture.pixels[8, 4].tolist() == [200, 0, 0]
        assert picture.pixels[8, 15].tolist() == [0, 0, 0]


@pytest.mark.parametrize(
    ("width", "height", "says"), [(32, 40, "look swapped"), (20, 200, "is stretched"), (32, 24, ""), (20, 16, "")]
)
def test_a_picture_of_another_shape_is_said_once(width, height, says, caplog):
    taker = intake()
    for _ in range(3):
        assert len(give(taker, CAMERA, messages.image(0, np.zeros((height, width, 3), np.uint8)))) == 1
    assert taker.picture_sizes == [{(width, height): 3}]
    assert len(caplog.records) == bool(says)
    assert says in caplog.text


def test_a_portrait_picture_for_a_landscape_network(caplog):
    taker = intake()
    for _ in range(3):
        give(taker, CAMERA, messages.image(0, np.zeros((40, 32, 3), np.uint8)))
    assert [record.getMessage() for record in caplog.records] == [
        f"{CAMERA}: a picture of width 32 and height 40, where the configuration has width 20 and height 16: width and "
        "height look swapped; swap them in the configuration, or turn the camera's picture"
    ]


def test_bad_messages_are_counted_by_what_they_are():
    taker = intake()
    odometry = messages.odometry(OdometrySample(9, np.array([math.nan, 2.0, 0.5])))
    jpeg = messages.compressed_image(0, np.zeros((9, 9, 3), np.uint8))
    jpeg.data = jpeg.data[::-1].copy()
    assert give(taker, "odom", odometry) == give(taker, CAMERA, jpeg) == give(taker, "odom", scan(1.0)) == []
    assert taker.events("range", "sensor_msgs/msg/LaserScan", b"\0\1\0\0garbage", 0) == []
    assert taker.events("range", "my_msgs/msg/Odd", b"", 0) == []
    assert taker.drops == {
        "odom: a pose that is not finite (NaN or infinite)": 1,
        f"{CAMERA}: not a decodable picture": 1,
        "odom: expected nav_msgs/msg/Odometry, got sensor_msgs/msg/LaserScan": 1,
        "range: not a sensor_msgs/msg/LaserScan": 1,
        "range: not a my_msgs/msg/Odd": 1,
    }


TYPES = [
    "sensor_msgs/msg/LaserScan",
    "nav_msgs/msg/Odometry",
    "sensor_msgs/msg/CompressedImage",
    "sensor_msgs/msg/Image",
    "std_msgs/msg/String",
    "no_such/msg/Type",
]


@given(
    topic=st.sampled_from(["odom", "range", CAMERA]),
    type_name=st.sampled_from(TYPES),
    data=st.binary(max_size=200),
    head=st.booleans(),
)
@settings(max_examples=150)
def test_nothing_that_comes_raises(topic, type_name, data, head):
    intake().events(topic, type_name, b"\0\1\0\0" + data if head else data, 0)


@needs_data
@given(st.data())
@settings(max_examples=50, deadline=None)
def test_nothing_that_was_once_a_message_raises(data):
    real = list(read(DATA / "drone" / "A0.mcap"))[:40]
    message = data.draw(st.sampled_from(real))
    content = bytearray(message.data)
    for at in data.draw(st.lists(st.integers(0, len(content) - 1), max_size=8)):
        content[at] = data.draw(st.integers(0, 255))
    cut = data.draw(st.integers(0, len(content)))
    Intake(load(ROOT / "configs" / "drone.toml")).events(message.topic, message.type, bytes(content[:cut]), 0)


def test_what_is_missing_is_named_with_what_came():
    taker = intake()
    assert str(taker.missing()).startswith(f"no message on: {CAMERA}, odom, range; what came: nothing")
    give(taker, "/bot/range", scan(1.0))
    give(taker, "/image", messages.image(0, np.zeros((9, 9, 3), np.uint8)))
    missing = taker.missing()
    assert missing is not None
    assert missing.topics == (CAMERA, "odom")
    assert "/bot/range (sensor_msgs/msg/LaserScan), /image (sensor_msgs/msg/Image)" in str(missing)
    give(taker, "odom", messages.odometry(OdometrySample(9, np.zeros(3))))
    give(taker, CAMERA, messages.image(0, np.zeros((9, 9, 3), np.uint8)))
    assert taker.missing() is None


@needs_data
@pytest.mark.parametrize(("name", "counts"), [("drone/A0", (97, 206, 217)), ("nao/2013062101", (312, 312, 312))])
def test_real_recordings_go_in_whole(name, counts, caplog):
    taker = Intake(load(ROOT / "configs" / f"{name.split('/')[0]}.toml"))
    events = [event for m in read(DATA / f"{name}.mcap") for event in taker.events(m.topic, m.type, m.data, m.log_ns)]
    found = tuple(sum(isinstance(event, kind) for event in events) for kind in (Picture, OdometrySample, Reading))
    assert found == counts
    assert not taker.drops
    assert taker.missing() is None
    assert not caplog.text
