"""What is read straight from the bytes against the same message decoded: equal, or left to decoding."""

import math
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from agents import messages
from agents.messages import MessageError
from agents.messages.codec import Header, Time
from agents.messages.shortcut import FlatPicture, FlatScan, flat_odometry, flat_picture, flat_scan
from llrp_online.events import OdometrySample

ODOMETRY, PICTURE = "nav_msgs/msg/Odometry", "sensor_msgs/msg/CompressedImage"
SCAN = "sensor_msgs/msg/LaserScan"
plain = st.text(st.characters(max_codepoint=127, exclude_characters="\0"), max_size=9)
anything = st.text(max_size=4)
stamps = st.builds(Time, st.integers(-(2**31), 2**31 - 1), st.integers(0, 2**32 - 1))
numbers = st.one_of(st.floats(-2, 2), st.floats())


@st.composite
def odometry(draw, names=plain):
    message = messages.odometry(OdometrySample(0, np.zeros(3)))
    message.header, message.child_frame_id = Header(draw(stamps), draw(names)), draw(names)
    at, q = message.pose.pose.position, message.pose.pose.orientation
    at.x, at.y, at.z = (draw(numbers) for _ in range(3))
    yaw = draw(st.floats(-math.pi, math.pi))
    q.x, q.y, q.z, q.w = draw(st.sampled_from([(0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)), (draw(numbers),) * 4]))
    message.pose.covariance = draw(arrays(np.float64, 36, elements=draw(st.sampled_from([numbers, st.just(0.0)]))))
    return message


@st.composite
def picture(draw, names=plain):
    message = messages.compressed_image(0, np.zeros((1, 1, 3), np.uint8))
    message.header, message.format = Header(draw(stamps), draw(names)), draw(names)
    message.data = np.frombuffer(draw(st.binary(max_size=40)), np.uint8)
    return message


@st.composite
def scan(draw, names=plain):
    single = st.floats(width=32)
    message = messages.laser_scan(0, [], (-1.0, 1.0), (0.0, 1.0))
    message.header = Header(draw(stamps), draw(names))
    message.ranges = np.array(draw(st.lists(single, max_size=6)), np.float32)
    message.intensities = np.array(draw(st.lists(single, max_size=3)), np.float32)
    return message


def sample(read, of):
    """As comparable values, or what the error says."""
    try:
        found = read(of)
    except MessageError as error:
        return str(error)
    if found is None:
        return None
    covariance = None if found.covariance is None else found.covariance.tolist()
    return found.t_ns, found.pose.tolist(), covariance


@settings(deadline=None)
@given(odometry())
def test_odometry_is_that_of_the_message(message):
    data = messages.encode(message)
    found = sample(messages.quick_odometry, data)
    assert found is not None
    assert repr(found) == repr(sample(messages.odometry_sample, messages.decode(ODOMETRY, data)))


@settings(deadline=None)
@given(picture())
def test_a_picture_is_that_of_the_message(message):
    data = messages.encode(message)
    assert flat_picture(data) == FlatPicture(
        messages.time_ns(message.header), message.format, np.asarray(message.data).tobytes()
    )


@settings(deadline=None)
@given(scan())
def test_a_scan_is_that_of_the_message(message):
    found = flat_scan(messages.encode(message))
    assert found is not None
    assert found.t_ns == messages.time_ns(message.header)
    np.testing.assert_array_equal(np.array(found.ranges, np.float32), message.ranges)


@settings(deadline=None)
@given(st.one_of(odometry(anything), picture(anything), scan(anything)), st.data())
def test_damaged_bytes_are_never_read_where_decoding_would_refuse_them(message, data):
    damaged = bytearray(messages.encode(message))
    for _ in range(data.draw(st.integers(0, 3))):
        # Mostly where lengths stand.
        damaged[data.draw(st.one_of(st.integers(0, 40), st.integers(0, len(damaged) - 1))) % len(damaged)] = data.draw(
            st.integers(0, 255)
        )
    cut = bytes(damaged[: data.draw(st.one_of(st.just(len(damaged)), st.integers(0, len(damaged))))])
    cut += bytes(data.draw(st.integers(0, 5)))
    for type_name, flat in ((ODOMETRY, flat_odometry(cut)), (PICTURE, flat_picture(cut)), (SCAN, flat_scan(cut))):
        if flat is not None:
            decoded = messages.decode(type_name, cut)
            assert flat.t_ns == messages.time_ns(decoded.header)
            if isinstance(flat, FlatPicture):
                assert (flat.codec, flat.data) == (decoded.format, decoded.data.tobytes())
            if isinstance(flat, FlatScan):
                np.testing.assert_array_equal(np.array(flat.ranges, np.float32), decoded.ranges)


@pytest.mark.parametrize("size", [0, 3, 11, 15, 16, 17])
def test_too_little_is_left_to_decoding(size):
    data = messages.encode(messages.odometry(OdometrySample(0, np.zeros(3))))[:size]
    assert flat_odometry(data) is None
    assert flat_picture(data) is None
    assert flat_scan(data) is None


def test_the_other_byte_order_is_left_to_decoding():
    data = struct.pack(">BBHiII", 0, 0, 0, 1, 2, 1) + bytes(1000)
    assert flat_odometry(data) is None
    assert flat_picture(data) is None
    assert flat_scan(data) is None
