"""What comes most often, odometry, scans and compressed pictures, read straight from its bytes.

Decoding makes an object of every part of a message, which costs more than all that is done with it afterwards. Here the
parts wanted are picked out where they stand. Only bytes laid out as nearly all are (little-endian, plain names, nothing
missing and nothing too much) are read; of others nothing is said, and they are decoded as any message is.
"""

import struct
from collections.abc import Sequence
from typing import NamedTuple

_HEADER = struct.Struct("<4xiII")  # the encoding, seconds, nanoseconds, length of the frame's name
_LENGTH = struct.Struct("<I")
_ODOMETRY = struct.Struct("<43d")  # position, orientation, covariance
_TWIST_BYTES = 42 * 8
_SCAN_NUMBERS_BYTES = 7 * 4  # angles, times and limits, before the ranges
_PADDING = 3  # bytes that may follow a message
_SECOND_NS = 1_000_000_000


class FlatOdometry(NamedTuple):
    """Parts of a nav_msgs/msg/Odometry: position (3,), quaternion x, y, z, w (4,) and pose covariance (36,)."""

    t_ns: int
    position: Sequence[float]
    orientation: Sequence[float]
    covariance: Sequence[float]


class FlatPicture(NamedTuple):
    """Parts of a sensor_msgs/msg/CompressedImage."""

    t_ns: int
    codec: str
    data: bytes


class FlatScan(NamedTuple):
    """Parts of a sensor_msgs/msg/LaserScan: ranges [m], NaN and infinities as they stand."""

    t_ns: int
    ranges: Sequence[float]


def flat_odometry(data: bytes) -> FlatOdometry | None:
    """None where the bytes are laid out in another way, or are damaged."""
    head = _header(data)
    if head is None:
        return None
    t_ns, end = head
    end = _string(data, _aligned(end, 4))
    begin = _aligned(end, 8)
    if not end or not 0 <= len(data) - (begin + _ODOMETRY.size + _TWIST_BYTES) <= _PADDING:
        return None
    values = _ODOMETRY.unpack_from(data, begin)
    return FlatOdometry(t_ns, values[:3], values[3:7], values[7:])


def flat_scan(data: bytes) -> FlatScan | None:
    """None where the bytes are laid out in another way, or are damaged."""
    head = _header(data)
    if head is None:
        return None
    t_ns, end = head
    begin = _aligned(end, 4) + _SCAN_NUMBERS_BYTES
    if begin + _LENGTH.size > len(data):
        return None
    (count,) = _LENGTH.unpack_from(data, begin)
    begin += _LENGTH.size
    intensities = begin + 4 * count
    if intensities + _LENGTH.size > len(data):
        return None
    (more,) = _LENGTH.unpack_from(data, intensities)
    if not 0 <= len(data) - (intensities + _LENGTH.size + 4 * more) <= _PADDING:
        return None
    return FlatScan(t_ns, struct.unpack_from(f"<{count}f", data, begin))


def flat_picture(data: bytes) -> FlatPicture | None:
    """None where the bytes are laid out in another way, or are damaged."""
    head = _header(data)
    if head is None:
        return None
    t_ns, end = head
    codec = _aligned(end, 4) + _LENGTH.size
    end = _string(data, codec - _LENGTH.size)
    begin = _aligned(end, 4) + _LENGTH.size
    if not end or begin > len(data):
        return None
    (size,) = _LENGTH.unpack_from(data, begin - _LENGTH.size)
    if not 0 <= len(data) - (begin + size) <= _PADDING:
        return None
    return FlatPicture(t_ns, data[codec : end - 1].decode("ascii"), data[begin : begin + size])


def _header(data: bytes) -> tuple[int, int] | None:
    """A header's time [ns], and where it ends."""
    if len(data) < _HEADER.size or data[0] or data[1] != 1:
        return None
    seconds, nanoseconds, _ = _HEADER.unpack_from(data)
    end = _string(data, _HEADER.size - _LENGTH.size)
    return (seconds * _SECOND_NS + nanoseconds, end) if end else None


def _string(data: bytes, begin: int) -> int:
    """Where the string that begins there ends; 0 if it is none, or not plain ASCII."""
    start = begin + _LENGTH.size
    if start > len(data):
        return 0
    (length,) = _LENGTH.unpack_from(data, begin)
    end = start + length
    plain = length and end <= len(data) and data[end - 1] == 0 and data[start : end - 1].isascii()
    return end if plain else 0


def _aligned(position: int, size: int) -> int:
    """Values stand at multiples of their size, counted from after the encoding."""
    return -(-(position - 4) // size) * size + 4
