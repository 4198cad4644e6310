"""What is in a stranger's recording: which topics could be camera, odometry and short range, and what their values are.

One pass; pictures are looked at until one could be decoded, and of each number a few thousand values are kept.
"""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from agents import messages
from agents.fields import read_field
from agents.messages import MessageError
from agents.topics import ODOMETRY_TYPE
from llrp_online.configuration.field import Field
from llrp_online.events import OdometrySample
from replay.recording import Message

PICTURES = ("sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Image")
#: Scans with no more beams than this are taken beam by beam, others by sectors.
FEW_BEAMS = 16
SECTORS_DEG = (("left", 15, 45), ("center", -15, 15), ("right", -45, -15))
_MOST_VALUES = 5000
_PICTURES_TRIED = 5
_EVENT_HZ = 1.0
_HAIR_RAD = 1e-3
_PARTS = ("left", "center", "right")


@dataclass(frozen=True)
class Candidate:
    """A field that could be a short-range sensor.

    Attributes:
        name: of the sensor.
        topic: as it stands in the recording.
        type: of its messages.
        field: where the number is.
        near_is_less: a distance; else something that grows when something is near.
        touch: 0 or 1 already.
        mirror: name of its mirror image; empty if that is to be told from its own.
    """

    name: str
    topic: str
    type: str
    field: str
    near_is_less: bool = True
    touch: bool = False
    mirror: str = ""


@dataclass
class Topic:
    """One topic, running: its type, messages, times, and for pictures their (width, height) or why there is none."""

    type: str
    count: int = 0
    first_ns: int = 0
    last_ns: int = 0
    size: tuple[int, int] | None = None
    fault: str = ""

    @property
    def rate_hz(self) -> float:
        """Messages a second."""
        span_ns = self.last_ns - self.first_ns
        return (self.count - 1) * 1e9 / span_ns if span_ns > 0 else 0.0


@dataclass
class Survey:
    """Looks at messages, one by one.

    Attributes:
        topics: all, by name.
        poses: of each topic that could be odometry.
        candidates: fields that could be short range, each with the values it had.
    """

    topics: dict[str, Topic] = field(default_factory=dict[str, Topic])
    poses: dict[str, list[OdometrySample]] = field(default_factory=lambda: defaultdict(list))
    candidates: dict[Candidate, list[float]] = field(default_factory=dict[Candidate, list[float]])
    _fields: dict[str, list[tuple[Candidate, Field]]] = field(default_factory=dict[str, list[tuple[Candidate, Field]]])

    def add(self, message: Message) -> None:
        """Take a message; never raises."""
        topic = self.topics.setdefault(message.topic, Topic(message.type, first_ns=message.log_ns))
        topic.count += 1
        topic.last_ns = message.log_ns
        try:
            if message.type in PICTURES:
                self._look(topic, message)
            elif message.type == ODOMETRY_TYPE:
                self.poses[message.topic].append(messages.odometry_sample(messages.decode(ODOMETRY_TYPE, message.data)))
            else:
                self._measure(message)
        except MessageError as error:
            topic.fault = topic.fault or str(error)

    def _look(self, topic: Topic, message: Message) -> None:
        if topic.size is None and topic.count <= _PICTURES_TRIED:
            pixels = messages.picture(messages.decode(message.type, message.data))
            topic.size = pixels.shape[1], pixels.shape[0]

    def _measure(self, message: Message) -> None:
        if message.topic not in self._fields:
            if message.type not in _FINDERS:
                self._fields[message.topic] = []
            else:
                found = list(_FINDERS[message.type](message, messages.decode(message.type, message.data)))
                if not found:
                    return  # such as a vector that is empty for now
                self._fields[message.topic] = [(candidate, Field.parse(candidate.field)) for candidate in found]
                self.candidates |= {candidate: [] for candidate in found}
        if not self._fields[message.topic]:
            return
        decoded = messages.decode(message.type, message.data)
        for candidate, way in self._fields[message.topic]:
            values = self.candidates[candidate]
            if len(values) < _MOST_VALUES and (value := read_field(decoded, way)) is not None:
                values.append(value)

    def is_event(self, topic: str) -> bool:
        """Whether it speaks so seldom that what it said must hold."""
        return self.topics[topic].rate_hz < _EVENT_HZ


def _scan(message: Message, decoded: Any) -> Iterator[Candidate]:
    if len(decoded.ranges) <= FEW_BEAMS:
        last = len(decoded.ranges) - 1
        even = abs(decoded.angle_min + decoded.angle_max) < _HAIR_RAD
        for beam in range(last, -1, -1):  # a scan counts counter-clockwise, so from the right
            mirror = f"beam_{last - beam}" if even else ""
            yield Candidate(f"beam_{beam}", message.topic, message.type, f"ranges[{beam}]", mirror=mirror)
        return
    for name, first, last in SECTORS_DEG:
        try:
            read_field(decoded, Field.parse(f"ranges[{first}deg:{last}deg]"))
        except MessageError:
            continue  # it does not look there
        yield Candidate(name, message.topic, message.type, f"ranges[{first}deg:{last}deg]")


def _range(message: Message, _decoded: Any) -> Iterator[Candidate]:
    yield Candidate(_called(message.topic), message.topic, message.type, "range")


def _bool(message: Message, _decoded: Any) -> Iterator[Candidate]:
    name = message.topic.lower()
    if any(word in name for word in ("bump", "contact", "touch", "cliff", "collision", "obstacle", "proximity")):
        yield Candidate(_called(message.topic), message.topic, message.type, "data", near_is_less=False, touch=True)


def _intensities(message: Message, decoded: Any) -> Iterator[Candidate]:
    for reading in decoded.readings:
        frame = str(reading.header.frame_id)
        way = f"readings[header.frame_id={frame}].value"
        yield Candidate(frame.removeprefix("ir_intensity_"), message.topic, message.type, way, near_is_less=False)


def _hazards(message: Message, _decoded: Any) -> Iterator[Candidate]:
    yield Candidate("bumper", message.topic, message.type, "detections[type=1]", near_is_less=False, touch=True)


def _bumper(message: Message, _decoded: Any) -> Iterator[Candidate]:
    for number, name in enumerate(_PARTS):
        way = f"[bumper={number}].state"
        yield Candidate(f"bumper_{name}", message.topic, message.type, way, near_is_less=False, touch=True)


_FINDERS = {
    "sensor_msgs/msg/LaserScan": _scan,
    "sensor_msgs/msg/Range": _range,
    "std_msgs/msg/Bool": _bool,
    "irobot_create_msgs/msg/IrIntensityVector": _intensities,
    "irobot_create_msgs/msg/HazardDetectionVector": _hazards,
    "kobuki_ros_interfaces/msg/BumperEvent": _bumper,
    "kobuki_msgs/msg/BumperEvent": _bumper,
}


def _called(topic: str) -> str:
    """A sensor's name from its topic's: `/sonar/left` is `sonar_left`."""
    return "_".join(part for part in topic.split("/")[-2:] if part and part not in ("range", "data", "state"))


def usual_speed_m_s(poses: list[OdometrySample]) -> tuple[float, float]:
    """Median and 99 % of the speed [m/s] between poses, standing still left out; 0 where it never moved."""
    t_s = np.array([pose.t_ns for pose in poses]) * 1e-9
    at = np.array([pose.pose[:2] for pose in poses])
    if len(poses) < 2:
        return 0.0, 0.0
    seconds = np.diff(t_s)
    speeds = np.hypot(*np.diff(at, axis=0)[seconds > 0].T) / seconds[seconds > 0]
    moving = speeds[speeds > 1e-3]
    return (float(np.median(moving)), float(np.quantile(moving, 0.99))) if len(moving) else (0.0, 0.0)
