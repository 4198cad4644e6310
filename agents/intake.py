"""From a robot's messages to what the learner takes in: poses, bits and pictures, as the configuration says.

Bad input never raises here. A sensor that sends nonsense for a second must not stop the learner, and one that sends
nothing else must not be silent about it: each kind of nonsense is counted under a sentence and logged at its first
time, its tenth, its hundredth and so on.
"""

import logging
import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from rosbags.typesys.stores.ros2_jazzy import std_msgs__msg__Header as Header

from agents import messages
from agents.fields import read_field
from agents.messages import MessageError
from agents.topics import ODOMETRY_TYPE, relative_topic
from llrp_online.configuration import RobotConfiguration
from llrp_online.configuration.field import Field
from llrp_online.events import Event, OdometrySample, Picture, Reading

logger = logging.getLogger(__name__)

# A picture may be this much wider or narrower in shape than the network's: 4:3 into 5:4 or 16:9 into 4:3 is a stretch
# that a camera's owner may well want, portrait into landscape is a mistake.
_STRETCH = 1.5
_MOST_TOPICS = 1000  # remembered for the error that names them; a stranger on the bus must not fill the memory
_SCAN = "sensor_msgs/msg/LaserScan"
_COMPRESSED, _IMAGE = "sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Image"


@dataclass(frozen=True)
class Missing:
    """Configured topics that never came; as a sentence with `str`.

    >>> str(Missing(("range",), {"/odom": "nav_msgs/msg/Odometry"}))
    'no message on: range; what came: /odom (nav_msgs/msg/Odometry). Make the topics in the configuration agree'
    """

    topics: tuple[str, ...]
    came: dict[str, str]

    def __str__(self) -> str:
        came = ", ".join(f"{topic} ({type_name})" for topic, type_name in sorted(self.came.items())) or "nothing"
        return f"no message on: {', '.join(self.topics)}; what came: {came}. Make the topics in the configuration agree"


class Intake:
    """Turns a robot's messages into events.

    Attributes:
        drops: how often something was dropped or left out, by a sentence that says where and why.
        picture_sizes: for each camera, how often pictures of which (width, height) came.
        latest: (S,) float64, for each sensor whose field is `latest` what was said of it last; NaN before.

    A leading slash and the robot's name before a topic do not matter. Times are the header's, and `received_ns` where a
    message has no header.

    >>> from pathlib import Path
    >>> from llrp_online.configuration import load
    >>> intake = Intake(load(Path("configs/thymio.toml")))
    >>> scan = messages.laser_scan(5, [0.02, np.inf, np.nan, 0.05, 0.2], (-0.7, 0.7), (0.0, 0.1))
    >>> [reading] = intake.events("/thymio/range", "sensor_msgs/msg/LaserScan", messages.encode(scan), received_ns=0)
    >>> reading.t_ns, reading.bits.tolist()
    (5, [0, 1, -1, 0, 1])
    """

    drops: Counter[str]
    picture_sizes: list[Counter[tuple[int, int]]]
    latest: NDArray[np.float64]

    def __init__(self, configuration: RobotConfiguration) -> None:
        self.drops = Counter()
        self.picture_sizes = [Counter() for _ in configuration.camera]
        self._robot = configuration.robot.name
        self._size = configuration.camera[0].width, configuration.camera[0].height
        self._sensors = len(configuration.short_range)
        self._takers: dict[str, list[Callable[[str, str, bytes, int], Event | None]]] = {}
        self._cameras: dict[str, int] = {}
        self._came: dict[str, str] = {}
        self._names: dict[str, str] = {}
        for index, camera in enumerate(configuration.camera):
            self._cameras[self._relative(camera.topic)] = index
            self._listen(camera.topic, self._picture)
        self._listen(configuration.odometry.topic, self._odometry)
        self._readings: dict[str, tuple[str, list[_Sensor]]] = {}
        self._latest: dict[str, NDArray[np.int8]] = {}
        self.latest = np.full(self._sensors, np.nan)
        for topic in configuration.range_topics:
            name = self._relative(topic)
            self._readings[name] = (
                topic,
                [
                    _Sensor(index, sensor.field, sensor.way(), sensor.way().beam, sensor.below, sensor.above)
                    for index, sensor in enumerate(configuration.short_range)
                    if self._relative(sensor.topic) == name
                ],
            )
            self._listen(topic, self._remember if topic in configuration.event_topics else self._reading)

    def events(self, topic: str, type_name: str, data: bytes, received_ns: int) -> list[Event]:
        """What a message means: no event, one, or several where the configuration uses its topic more than once."""
        name = self._names.get(topic) or self._relative(topic)
        if topic not in self._came and len(self._came) < _MOST_TOPICS:
            self._came[topic], self._names[topic] = type_name, name
        found = [take(name, type_name, data, received_ns) for take in self._takers.get(name, [])]
        events = [event for event in found if event is not None]
        if self._latest and (sample := next((event for event in events if isinstance(event, OdometrySample)), None)):
            # What holds is said again with every pose: silence between two events is a reading, too.
            return [*(Reading(sample.t_ns, name, bits.copy()) for name, bits in self._latest.items()), *events]
        return events

    def missing(self) -> Missing | None:
        """The configured topics that have not come so far; None if all have."""
        seen = dict(self._came)  # a copy: it may be asked from another thread than the one that takes messages in
        came = {self._relative(topic) for topic in seen}
        topics = tuple(topic for topic in self._takers if topic not in came)
        return Missing(topics, seen) if topics else None

    def _relative(self, topic: str) -> str:
        return relative_topic(self._robot, topic)

    def _listen(self, topic: str, take: Callable[[str, str, bytes, int], Event | None]) -> None:
        self._takers.setdefault(self._relative(topic), []).append(take)

    def _odometry(self, topic: str, type_name: str, data: bytes, _received_ns: int) -> OdometrySample | None:
        if not self._expect(topic, type_name, (ODOMETRY_TYPE,)):
            return None
        try:
            if (sample := messages.quick_odometry(data)) is not None:
                return sample
            message = self._decode(topic, type_name, data)
            return None if message is None else messages.odometry_sample(message)
        except MessageError as error:
            self._drop(f"{topic}: {error}")
            return None

    def _reading(self, topic: str, type_name: str, data: bytes, received_ns: int) -> Reading | None:
        configured, sensors = self._readings[topic]
        if type_name == _SCAN and (scan := messages.flat_scan(data)) is not None:
            quick = [-1] * self._sensors
            for sensor in sensors:
                if not 0 <= sensor.beam < len(scan.ranges):
                    break
                quick[sensor.index] = sensor.bit(scan.ranges[sensor.beam])
            else:
                return Reading(scan.t_ns, configured, np.array(quick, np.int8))
        values = self._values(topic, type_name, data, sensors)
        if values is None:
            return None
        message, found = values
        bits = np.full(self._sensors, -1, np.int8)
        for sensor, value in found:
            bits[sensor.index] = sensor.bit(value)
        return Reading(_time_ns(message, received_ns), configured, bits) if found else None

    def _remember(self, topic: str, type_name: str, data: bytes, _received_ns: int) -> None:
        """What an event says holds from now on; it goes out with the poses that come."""
        configured, sensors = self._readings[topic]
        values = self._values(topic, type_name, data, sensors)
        for sensor, value in values[1] if values is not None else ():
            self.latest[sensor.index] = value
            bits = self._latest.setdefault(configured, np.full(self._sensors, -1, np.int8))
            bits[sensor.index] = sensor.bit(value)

    def _values(
        self, topic: str, type_name: str, data: bytes, sensors: list["_Sensor"]
    ) -> tuple[object, list[tuple["_Sensor", float]]] | None:
        """The message, and what it says of which sensor."""
        message = self._decode(topic, type_name, data)
        if message is None:
            return None
        found: list[tuple[_Sensor, float]] = []
        for sensor in sensors:
            try:
                value = read_field(message, sensor.field)
                found += [] if value is None else [(sensor, value)]
            except MessageError as error:
                self._drop(f"{topic}: no `{sensor.text}` in a {type_name}", str(error))
        return message, found

    def _picture(self, topic: str, type_name: str, data: bytes, received_ns: int) -> Picture | None:
        if not self._expect(topic, type_name, (_COMPRESSED, _IMAGE)):
            return None
        try:
            found = messages.quick_picture(data) if type_name == _COMPRESSED else None
            if found is None:
                message = self._decode(topic, type_name, data)
                if message is None:
                    return None
                found = _time_ns(message, received_ns), messages.picture(message)
        except MessageError as error:
            self._drop(f"{topic}: not a decodable picture", str(error).removeprefix("not a decodable picture: "))
            return None
        t_ns, pixels = found
        camera = self._cameras[topic]
        self._compare_shape(topic, camera, (pixels.shape[1], pixels.shape[0]))
        if pixels.shape[1::-1] != self._size:
            pixels = np.asarray(cv2.resize(pixels, self._size, interpolation=cv2.INTER_LINEAR), np.uint8)
        return Picture(t_ns, camera, pixels)

    def _expect(self, topic: str, type_name: str, expected: tuple[str, ...]) -> bool:
        if type_name not in expected:
            self._drop(f"{topic}: expected {' or '.join(expected)}, got {type_name}")
        return type_name in expected

    def _decode(self, topic: str, type_name: str, data: bytes) -> object | None:
        try:
            return messages.decode(type_name, data)
        except MessageError as error:
            self._drop(f"{topic}: not a {type_name}", str(error))
            return None

    def _compare_shape(self, topic: str, camera: int, size: tuple[int, int]) -> None:
        sizes = self.picture_sizes[camera]
        if size not in sizes and len(sizes) < _MOST_TOPICS and (fault := shape_fault(size, self._size)):
            logger.warning("%s: %s", topic, fault)
        if size in sizes or len(sizes) < _MOST_TOPICS:
            sizes[size] += 1

    def _drop(self, what: str, detail: str = "") -> None:
        self.drops[what] += 1
        count = self.drops[what]
        if 10 ** (len(str(count)) - 1) == count:
            logger.warning("%s%s (%d so far)", what, f": {detail}" if detail else "", count)


@dataclass(frozen=True)
class _Sensor:
    index: int
    text: str
    field: Field
    beam: int  # of a scan; -1: the field says something else
    below: float | None
    above: float | None

    def bit(self, value: float) -> int:
        """NaN is unknown; infinities are just very far and very near."""
        if math.isnan(value):
            return -1
        return int(value < self.below) if self.below is not None else int(self.above is not None and value > self.above)


def shape_fault(size: tuple[int, int], wanted: tuple[int, int]) -> str | None:
    """What is wrong with pictures of `size` (width, height) for a network that sees `wanted`; None if nothing is.

    >>> shape_fault((324, 244), (80, 64)) is None
    True
    """
    stretch = (size[0] / size[1]) / (wanted[0] / wanted[1])
    if 1 / _STRETCH <= stretch <= _STRETCH:
        return None
    swapped = (size[1] / size[0]) / (wanted[0] / wanted[1])
    if 1 / _STRETCH <= swapped <= _STRETCH:
        advice = "width and height look swapped; swap them in the configuration, or turn the camera's picture"
    else:
        advice = "it is stretched to fit; give the configuration a width and height of the picture's shape"
    return (
        f"a picture of width {size[0]} and height {size[1]}, where the configuration has width {wanted[0]} and "
        f"height {wanted[1]}: {advice}"
    )


def _time_ns(message: object, received_ns: int) -> int:
    stamped = getattr(message, "header", None)
    return messages.time_ns(stamped) if isinstance(stamped, Header) else received_ns
