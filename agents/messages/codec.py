"""CDR to messages and back (rosbags), with ROS 2 Jazzy's types and those of a few robots."""

import struct
from functools import cache

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.stores.ros2_jazzy import builtin_interfaces__msg__Time as Time
from rosbags.typesys.stores.ros2_jazzy import std_msgs__msg__Header as Header

from agents.messages.others import DEFINITIONS

_STORE = get_typestore(Stores.ROS2_JAZZY)
for _name, _text in DEFINITIONS.items():
    _STORE.register(get_types_from_msg(_text, _name))
_STAMP = {0: struct.Struct(">iI"), 1: struct.Struct("<iI")}  # by the CDR header's second byte
_SECOND_NS = 1_000_000_000
# What ROS 2 Iron put at the end of a type, in bytes: messages of ROS 1 and of ROS 2 up to Humble lack it.
_ADDED = {"sensor_msgs/msg/Range": 4}


class MessageError(ValueError):
    """Bytes or values that are not the message they should be; says what was got and what was expected."""


def encode(message: object) -> bytes:
    """A message to CDR.

    >>> encode(header(5, "odom"))[:12].hex()
    '000100000000000005000000'
    """
    type_name = getattr(message, "__msgtype__", None)
    if not isinstance(type_name, str):
        raise MessageError(f"expected a ROS 2 message, got {type(message).__name__}")
    try:
        return bytes(_STORE.serialize_cdr(message, type_name))
    # Values of the wrong type or out of range make the generated code raise many kinds of error.
    except Exception as error:
        raise MessageError(f"{type_name}: a value does not fit its field: {error}") from error


def decode(type_name: str, data: bytes) -> object:
    """CDR to a message whose fields are attributes; MessageError on an unknown type or on bytes that are not one.

    Arrays are read-only views of `data`. A field that an older ROS 2 lacked is 0.

    >>> decode("std_msgs/msg/Bool", bytes([0, 1, 0, 0, 1])).data
    True
    """
    _check_known(type_name)
    try:
        return _deserialize(type_name, data)
    # Damaged bytes give array lengths and strings that make the generated code raise many kinds of error.
    except Exception as error:
        raise MessageError(f"not a {type_name}: {len(data)} bytes that cannot be decoded: {error}") from error


def _deserialize(type_name: str, data: bytes) -> object:
    try:
        return _STORE.deserialize_cdr(data, type_name)
    except Exception:
        if type_name not in _ADDED:
            raise
        return _STORE.deserialize_cdr(data + bytes(_ADDED[type_name]), type_name)


def definition(type_name: str) -> str:
    """A type's definition in `ros2msg`, with those it is made of, as recordings carry it.

    >>> definition("std_msgs/msg/Bool")
    'bool data\\n'
    """
    _check_known(type_name)
    return _STORE.generate_msgdef(type_name, ros_version=2)[0]


def type_hash(type_name: str) -> str:
    """A type's hash (REP 2011), as ROS 2 Iron and later know it.

    >>> type_hash("std_msgs/msg/Bool")[:15]
    'RIHS01_feb91e99'
    """
    _check_known(type_name)
    return _STORE.hash_rihs01(type_name)


def header(t_ns: int, frame: str) -> Header:
    """A header of sensor time `t_ns` in the coordinate frame `frame`."""
    return Header(Time(*divmod(t_ns, _SECOND_NS)), frame)


def time_ns(stamped: Header) -> int:
    """A header's time [ns].

    >>> time_ns(header(-1, "odom"))
    -1
    """
    return stamped.stamp.sec * _SECOND_NS + stamped.stamp.nanosec


def stamp_ns(type_name: str, data: bytes) -> int | None:
    """The header's time [ns] without decoding the rest; None where the type has no header or the bytes no room for it.

    >>> stamp_ns("std_msgs/msg/Bool", bytes([0, 1, 0, 0, 1])) is None
    True
    """
    if not _begins_with_header(type_name) or len(data) < 12 or data[1] not in _STAMP:
        return None
    seconds, nanoseconds = _STAMP[data[1]].unpack_from(data, 4)
    return seconds * _SECOND_NS + nanoseconds


@cache
def _begins_with_header(type_name: str) -> bool:
    fields = _STORE.fielddefs[type_name][1] if type_name in _STORE.fielddefs else []
    return bool(fields) and fields[0][1] == (Nodetype.NAME, "std_msgs/msg/Header")


def _check_known(type_name: str) -> None:
    if type_name not in _STORE.fielddefs:
        raise MessageError(
            f"{type_name!r}: no type of ROS 2 Jazzy or of a robot known; expected a name such as "
            "'sensor_msgs/msg/LaserScan'"
        )
