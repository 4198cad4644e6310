"""All checks over one stream of messages."""

from collections.abc import Iterable

from agents import messages
from agents.checks.clocks import TopicClock, disagreement
from agents.checks.finding import Finding
from agents.checks.motion import Motion
from agents.checks.pictures import Pictures
from agents.checks.ranges import Range
from agents.fields import read_field
from agents.intake import Intake
from agents.messages import MessageError
from agents.topics import relative_topic
from llrp_online.configuration import RobotConfiguration
from llrp_online.events import OdometrySample, Picture, Reading
from replay.recording import Message

_ORDER = {"error": 0, "warning": 1, "note": 2}
_MANY_DROPS_SHARE = 0.1
# Words of a drop's sentence -> likely cause and mend.
_DROPS = {
    "picture": ("damaged on the way, or in another format", "send JPEG or PNG, or raw rgb8, bgr8 or mono8"),
    "finite": ("an estimator that diverged, or a division by zero in a driver", "mend it at the driver"),
    "quaternion": ("orientation never filled in, or angles put where the quaternion goes", "make it from yaw / 2"),
    "no `": ("the configuration names another field than the message has", "make `field` agree with the message"),
    "expected": ("a topic of another type than the configuration means", "make the topic's name agree"),
    "not a": ("bytes damaged on the way, or a wrong type name in the recording", "record again from the source"),
}


class Checker:
    """Judges messages against a configuration; `findings` may be asked at any time.

    >>> from pathlib import Path
    >>> from llrp_online.configuration import load
    >>> checker = Checker(load(Path("configs/thymio.toml")))
    >>> checker.add(Message("/image", "sensor_msgs/msg/Image", 0, b""))
    >>> [finding.topic for finding in checker.findings()]
    ['camera/image/compressed', 'odom', 'range']
    """

    def __init__(self, configuration: RobotConfiguration) -> None:
        self._robot = configuration.robot.name
        self._intake = Intake(configuration)
        self._motion = Motion(configuration.odometry)
        size = configuration.camera[0].width, configuration.camera[0].height
        self._pictures = [Pictures(camera.topic, size) for camera in configuration.camera]
        self._sensors = [(sensor, sensor.way()) for sensor in configuration.short_range]
        self._ranges = [Range(sensor) for sensor, _ in self._sensors]
        delay_s = configuration.odometry.max_delay_s
        cameras = {relative_topic(self._robot, camera.topic) for camera in configuration.camera}
        odometry = relative_topic(self._robot, configuration.odometry.topic)
        ranges = [relative_topic(self._robot, topic) for topic in configuration.range_topics]
        self._clocks = {
            topic: TopicClock(
                topic, delay_s, configuration.odometry.max_gap_s if topic == odometry else None, topic in cameras
            )
            for topic in dict.fromkeys([*cameras, odometry, *ranges])
        }

    def add(self, message: Message) -> None:
        """Take a message; never raises."""
        topic = relative_topic(self._robot, message.topic)
        if topic in self._clocks:
            stamp_ns = messages.stamp_ns(message.type, message.data)
            self._clocks[topic].add(message.log_ns if stamp_ns is None else stamp_ns, message.log_ns)
        for event in self._intake.events(message.topic, message.type, message.data, message.log_ns):
            if isinstance(event, OdometrySample):
                self._motion.add(event)
            elif isinstance(event, Picture):
                self._pictures[event.camera].add(event.pixels)
            else:
                self._add_ranges(message, event)

    def findings(self) -> list[Finding]:
        """All findings so far, errors first."""
        found = [*self._missing(), *self._dropped()]
        clocks = list(self._clocks.values())
        found += [finding for clock in clocks if clock.count for finding in clock.findings()]
        found += disagreement(clocks)
        for pictures, sizes in zip(self._pictures, self._intake.picture_sizes, strict=True):
            found += pictures.findings(sizes)
        found += self._motion.findings()
        found += [finding for values in self._ranges for finding in values.findings()]
        return sorted(found, key=lambda finding: _ORDER[finding.severity])

    def _add_ranges(self, message: Message, reading: Reading) -> None:
        decoded: object = None
        for index, (sensor, field) in enumerate(self._sensors):
            if sensor.topic != reading.topic:
                continue
            if field.latest:
                self._ranges[index].add(float(self._intake.latest[index]), int(reading.bits[index]))
                continue
            decoded = messages.decode(message.type, message.data) if decoded is None else decoded
            try:
                value = read_field(decoded, field)
            except MessageError:
                continue  # counted by the intake
            if value is not None:
                self._ranges[index].add(value, int(reading.bits[index]))

    def _missing(self) -> list[Finding]:
        missing = self._intake.missing()
        if missing is None:
            return []
        came = ", ".join(sorted(missing.came)) or "nothing"
        return [
            Finding("error", topic, "no message", f"another name: what came is {came}", "name it in the configuration")
            for topic in missing.topics
        ]

    def _dropped(self) -> list[Finding]:
        found: list[Finding] = []
        for what, count in self._intake.drops.items():
            topic, _, seen = what.partition(": ")
            total = self._clocks[topic].count
            cause, mend = next((advice for word, advice in _DROPS.items() if word in seen), ("", ""))
            severity = "error" if count > _MANY_DROPS_SHARE * total else "warning"
            found.append(Finding(severity, topic, f"{count} of {total} messages: {seen}", cause, mend))
        return found


def check(stream: Iterable[Message], configuration: RobotConfiguration) -> list[Finding]:
    """The findings over a whole recording, errors first."""
    checker = Checker(configuration)
    for message in stream:
        checker.add(message)
    return checker.findings()
