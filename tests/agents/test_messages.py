import logging
import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from agents import messages
from agents.messages import MessageError
from agents.messages.codec import Header, Time
from llrp_online.events import OdometrySample
from replay.poses import wrap
from replay.recording import read

DATA = Path(__file__).parents[2].parent / "shared" / "data"
needs_data = pytest.mark.skipif(not DATA.exists(), reason=f"the real recordings are not at {DATA}")

times_ns = st.integers(-(2**31) * 10**9, 2**31 * 10**9 - 1)
metres = st.floats(-1e3, 1e3)
angles = st.floats(-math.pi, math.pi)
names = st.lists(st.from_regex(r"[a-w]{1,8}", fullmatch=True), min_size=1, max_size=5, unique=True)
poses = st.lists(st.tuples(metres, metres, angles), min_size=1, max_size=10)


def through(message):
    """To bytes and back."""
    return messages.decode(message.__msgtype__, messages.encode(message))


@given(times_ns)
def test_times_are_exact(t_ns):
    header = messages.header(t_ns, "odom")
    assert messages.time_ns(header) == t_ns
    scan = messages.laser_scan(t_ns, [1.0], (0.0, 0.0), (0.0, 4.0))
    assert messages.stamp_ns("sensor_msgs/msg/LaserScan", messages.encode(scan)) == t_ns


@pytest.mark.parametrize("t_ns", [2**31 * 10**9, -(2**31) * 10**9 - 1])
def test_a_time_that_ros_cannot_say_is_an_error(t_ns):
    with pytest.raises(MessageError, match="does not fit"):
        messages.encode(messages.header(t_ns, "odom"))


@given(t_ns=times_ns, x=metres, y=metres, yaw=angles, root=arrays(np.float64, (3, 3), elements=st.floats(-10, 10)))
def test_odometry_goes_there_and_back(t_ns, x, y, yaw, root):
    sample = OdometrySample(t_ns, np.array([x, y, yaw]), root @ root.T)
    back = messages.odometry_sample(through(messages.odometry(sample)))
    assert back.t_ns == t_ns
    assert back.pose[:2].tolist() == [x, y]
    assert abs(float(wrap(back.pose[2] - yaw))) < 1e-9
    np.testing.assert_array_equal(back.covariance, sample.covariance)  # also where it is all zero: a certain pose


def changed(change):
    message = messages.odometry(OdometrySample(0, np.zeros(3), np.eye(3)))
    change(message.pose)
    return message


@pytest.mark.parametrize("first", [-1.0, 0.0, math.nan])
def test_a_covariance_not_given_is_none(first):
    covariance = np.zeros(36)
    covariance[0] = first
    message = changed(lambda pose: setattr(pose, "covariance", covariance))
    assert messages.odometry_sample(through(message)).covariance is None


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda pose: setattr(pose.pose.position, "x", math.nan), "not finite"),
        (lambda pose: setattr(pose.pose.position, "y", math.inf), "not finite"),
        (lambda pose: setattr(pose.pose.orientation, "z", math.nan), "not finite"),
        (lambda pose: setattr(pose.pose.orientation, "w", 0.0), "no unit quaternion"),
        (lambda pose: setattr(pose.pose.orientation, "z", 90.0), "no unit quaternion"),
    ],
)
def test_a_pose_that_is_none_is_an_error(change, says):
    with pytest.raises(MessageError, match=says):
        messages.odometry_sample(changed(change))


def test_yaw_is_taken_from_a_tilted_robot():
    yaw, pitch = 0.7, 0.3

    def tilt(pose):
        q = pose.pose.orientation
        q.w, q.x = math.cos(yaw / 2) * math.cos(pitch / 2), -math.sin(yaw / 2) * math.sin(pitch / 2)
        q.y, q.z = math.cos(yaw / 2) * math.sin(pitch / 2), math.sin(yaw / 2) * math.cos(pitch / 2)

    assert messages.odometry_sample(changed(tilt)).pose[2] == pytest.approx(yaw)


pixels = arrays(np.uint8, st.tuples(st.integers(1, 20), st.integers(1, 20), st.just(3)))


@given(pixels)
@settings(deadline=None)
def test_pictures_without_loss_go_there_and_back(picture):
    for message in (messages.compressed_image(5, picture, "png"), messages.image(5, picture)):
        np.testing.assert_array_equal(messages.picture(through(message)), picture)


def test_a_jpeg_keeps_red_red():
    red = np.full((16, 24, 3), [200, 30, 10], np.uint8)
    found = messages.picture(through(messages.compressed_image(5, red)))
    assert found.shape == (16, 24, 3)
    assert abs(found.astype(int) - red).max() < 6


@pytest.mark.parametrize(("encoding", "channels"), [("rgb8", 3), ("bgr8", 3), ("mono8", 1)])
def test_raw_images_with_padded_rows(encoding, channels):
    rng = np.random.default_rng(0)
    height, width, step = 4, 5, 5 * channels + 7
    rows = rng.integers(0, 256, (height, step), np.uint8)
    message = messages.image(5, np.zeros((height, width, 3), np.uint8))
    message.encoding, message.step, message.data = encoding, step, rows.ravel()
    values = rows[:, : width * channels].reshape(height, width, channels)
    expected = {"rgb8": values, "bgr8": values[..., ::-1], "mono8": values.repeat(3, -1)}[encoding]
    np.testing.assert_array_equal(messages.picture(through(message)), expected)


def test_a_grey_jpeg_becomes_rgb():
    _, data = cv2.imencode(".jpg", np.full((8, 8), 99, np.uint8))
    message = messages.compressed_image(0, np.zeros((1, 1, 3), np.uint8))
    message.data = data.ravel()
    assert messages.picture(message)[0, 0].tolist() == [99, 99, 99]


def spoilt(**fields):
    message = messages.image(5, np.zeros((4, 5, 3), np.uint8))
    for name, value in fields.items():
        setattr(message, name, value)
    return message


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"encoding": "32FC1"}, "encoding '32FC1'; expected one of rgb8, bgr8, mono8"),
        ({"height": 5}, "needs 75 bytes and at least one pixel, got 60"),
        ({"step": 14}, "step 14"),
        ({"width": 0, "height": 0}, "0x0"),
        ({"height": 2**32 - 1, "step": 2**32 - 1}, "got 60"),
    ],
)
def test_a_raw_image_that_is_none_is_an_error(fields, says):
    with pytest.raises(MessageError, match=says):
        messages.picture(through(spoilt(**fields)))


@given(st.binary(max_size=300))
def test_garbage_is_no_picture(data):
    message = messages.compressed_image(0, np.zeros((1, 1, 3), np.uint8))
    message.data = np.frombuffer(data, np.uint8)
    with pytest.raises(MessageError, match="not a decodable picture"):
        messages.picture(message)


def test_a_jpeg_cut_short_is_no_picture():
    noise = np.random.default_rng(0).integers(0, 256, (64, 64, 3), np.uint8)
    message = messages.compressed_image(0, noise)
    message.data = message.data[: len(message.data) // 2]
    with pytest.raises(MessageError, match="cut short"):
        messages.picture(message)


@given(t_ns=times_ns, at=poses, sensors=names, data=st.data())
def test_predictions_and_labels_go_there_and_back(t_ns, at, sensors, data):
    shape = len(at), len(sensors)
    probabilities = data.draw(arrays(np.float32, shape, elements=st.floats(0, 1, width=32)))
    labels = data.draw(arrays(np.int8, shape, elements=st.integers(-1, 1)))
    at = np.float32(at).astype(np.float64)
    found = messages.read_prediction(through(messages.prediction(t_ns, at, sensors, probabilities)))
    assert (found.t_ns, found.sensors) == (t_ns, tuple(sensors))
    np.testing.assert_array_equal(found.poses, at)
    np.testing.assert_array_equal(found.probabilities, probabilities)
    cloud = through(messages.labels(t_ns, at, sensors, labels, probabilities))
    assert cloud.is_dense == bool((labels >= 0).all())
    back = messages.read_labels(cloud)
    assert (back.t_ns, back.sensors) == (t_ns, tuple(sensors))
    np.testing.assert_array_equal(back.labels, labels)
    np.testing.assert_array_equal(back.weight, probabilities)


def test_clouds_that_are_none_are_errors():
    good = messages.prediction(0, [[0.0, 0.0, 0.0]], ["left"], [[0.5]])
    with pytest.raises(MessageError, match="each sensor with its _weight field"):
        messages.read_labels(good)
    with pytest.raises(MessageError, match="name of its own"):
        messages.prediction(0, [[0.0, 0.0, 0.0]], ["yaw"], [[0.5]])
    with pytest.raises(MessageError, match=r"got shapes \(1, 3\) and \(1, 2\)"):
        messages.prediction(0, [[0.0, 0.0, 0.0]], ["left"], [[0.5, 0.5]])
    good.data = good.data[:-1]
    with pytest.raises(MessageError, match="1 points need 20 bytes, got 19"):
        messages.read_prediction(good)
    good.fields = good.fields[:3]
    with pytest.raises(MessageError, match=r"without \['yaw'\]"):
        messages.read_prediction(good)
    good.fields[0].offset = 99
    with pytest.raises(MessageError, match="'x' is no float32 within 20 bytes"):
        messages.read_prediction(good)


@given(st.floats(-10, 10), st.floats(-10, 10))
def test_speed_commands_go_there_and_back(speed_m_s, turn_rad_s):
    assert messages.read_twist(through(messages.twist(speed_m_s, turn_rad_s))) == (speed_m_s, turn_rad_s)


def test_a_speed_command_that_is_not_finite_is_an_error():
    with pytest.raises(MessageError, match="not finite: nan m/s"):
        messages.read_twist(messages.twist(math.nan, 0.0))


@given(st.dictionaries(st.text(max_size=9), st.one_of(st.integers(), st.floats(allow_nan=False), st.just("running"))))
def test_a_status_goes_there_and_back(values):
    assert messages.read_diagnostics(through(messages.diagnostic_array(0, "learner", values))) == values


def test_a_status_takes_numpy_numbers():
    status = messages.diagnostic_array(0, "learner", {"loss": np.float32(0.5), "steps": np.int64(3), "on": np.True_})
    assert messages.read_diagnostics(status) == {"loss": 0.5, "steps": 3, "on": 1.0}


TYPES = ["sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry", "diagnostic_msgs/msg/DiagnosticArray"]


@given(type_name=st.sampled_from(TYPES), data=st.binary(max_size=400), head=st.booleans())
def test_garbage_never_raises_anything_but_a_message_error(type_name, data, head):
    try:
        messages.decode(type_name, b"\0\1\0\0" + data if head else data)
    except MessageError as error:
        logging.debug("%s", error)


def test_errors_say_what_was_got():
    with pytest.raises(MessageError, match="not a sensor_msgs/msg/LaserScan: 4 bytes that cannot be decoded"):
        messages.decode("sensor_msgs/msg/LaserScan", b"\0\1\0\0")
    with pytest.raises(MessageError, match="'sensor_msgs/LaserScan': no type of ROS 2"):
        messages.decode("sensor_msgs/LaserScan", b"")
    with pytest.raises(MessageError, match="expected a ROS 2 message, got str"):
        messages.encode("hello")
    with pytest.raises(MessageError, match="does not fit"):
        messages.encode(Header(Time(0, -1), "odom"))
    for reader in (messages.odometry_sample, messages.picture, messages.read_prediction, messages.read_twist):
        with pytest.raises(MessageError, match="got std_msgs/msg/Header"):
            reader(Header(Time(0, 0), ""))
    with pytest.raises(MessageError, match="got str"):
        messages.read_diagnostics("hello")
    assert "float32[] ranges" in messages.definition("sensor_msgs/msg/LaserScan")


@needs_data
def test_real_messages_decode_and_encode_to_what_they_were():
    for message in read(DATA / "nao" / "2013062101.mcap"):
        decoded = messages.decode(message.type, message.data)
        assert messages.encode(decoded) == message.data
        assert messages.stamp_ns(message.type, message.data) == messages.time_ns(decoded.header)
