"""One drive's messages as bags of every kind, written by rosbags."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rosbags.rosbag1 import Writer as Bag1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Bag2
from rosbags.typesys import Stores, get_typestore

from replay.recording import Message

JAZZY, NOETIC = get_typestore(Stores.ROS2_JAZZY), get_typestore(Stores.ROS1_NOETIC)
RANGE, BOOL, SCAN = "sensor_msgs/msg/Range", "std_msgs/msg/Bool", "sensor_msgs/msg/LaserScan"
STORAGE = {"mcap": StoragePlugin.MCAP, "sqlite3": StoragePlugin.SQLITE3}
COMPRESSION = {
    "none": CompressionMode.NONE,
    "file": CompressionMode.FILE,
    "message": CompressionMode.MESSAGE,
    "storage": CompressionMode.STORAGE,
}


def write_ros2(path: Path, messages: Sequence[Message], storage: str = "mcap", compression: str = "none") -> Path:
    """A rosbag2 folder."""
    writer = Bag2(path, version=9, storage_plugin=STORAGE[storage])
    if compression != "none":
        writer.set_compression(COMPRESSION[compression], CompressionFormat.ZSTD)
    with writer:
        connections = {
            topic: writer.add_connection(topic, kind, typestore=JAZZY)
            for topic, kind in dict.fromkeys((m.topic, m.type) for m in messages)
        }
        for message in messages:
            writer.write(connections[message.topic], message.log_ns, message.data)
    return path


def write_ros1(path: Path, messages: Sequence[Message]) -> Path:
    """A ROS 1 bag of the same."""
    with Bag1(path) as writer:
        connections = {
            topic: writer.add_connection(topic, kind, typestore=NOETIC)
            for topic, kind in dict.fromkeys((m.topic, m.type) for m in messages)
        }
        for message in messages:
            decoded = JAZZY.deserialize_cdr(message.data, message.type)
            data = NOETIC.serialize_ros1(_of_ros1(decoded, message.type), message.type)
            writer.write(connections[message.topic], message.log_ns, data)
    return path


def drive(count: int = 60) -> list[Message]:
    """Scans, ranges and a switch, each at its own pace."""
    header = JAZZY.types["std_msgs/msg/Header"]
    time = JAZZY.types["builtin_interfaces/msg/Time"]
    found: list[Message] = []
    for i in range(count):
        at = header(time(i, 5), "base_link")
        ranges = np.linspace(0.1, 1 + i, 40, dtype=np.float32)
        scan = JAZZY.types[SCAN](at, -1.0, 1.0, 0.1, 0.0, 0.0, 0.1, 4.0, ranges, np.zeros(0, np.float32))
        near = JAZZY.types[RANGE](at, 0, 0.5, 0.02, 4.0, i / 10, 0.0)
        for topic, kind, message in (
            ("/scan", SCAN, scan),
            ("/sonar", RANGE, near),
            ("/bump", BOOL, JAZZY.types[BOOL](i % 7 == 0)),
        ):
            found.append(Message(topic, kind, i * 10**8 + len(found), bytes(JAZZY.serialize_cdr(message, kind))))
    return found


def _of_ros1(message: object, kind: str) -> object:
    """The same values as a message of ROS 1: its header counts, and fields that came later are left out."""
    values = {}
    for name, of in NOETIC.fielddefs[kind][1]:
        if name == "seq":
            values[name] = 7
            continue
        value = getattr(message, name)
        values[name] = _of_ros1(value, of[1]) if hasattr(value, "__msgtype__") else value
    return NOETIC.types[kind](**values)
