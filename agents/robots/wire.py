"""What the simulated robot says, as messages: the same bytes live on the bus and in a recording in virtual time."""

import math
from collections.abc import Iterator

from agents import messages
from agents.robots.simulated import Observation
from agents.topics import ODOMETRY_TYPE
from llrp_online.configuration import RobotConfiguration
from llrp_online.events import OdometrySample
from replay.recording import Message

RANGE_TYPE = "sensor_msgs/msg/LaserScan"
PICTURE_TYPE = "sensor_msgs/msg/CompressedImage"
#: High enough that what JPEG loses is less than the augmentation's noise.
JPEG_QUALITY = 95


class Wire:
    """Observations into messages.

    Args:
        configuration: the robot's; its first range topic and its only camera are used.
    """

    def __init__(self, configuration: RobotConfiguration) -> None:
        simulation = configuration.simulated()
        if len(configuration.camera) != 1 or len(configuration.range_topics) != 1:
            raise ValueError("the simulated robot has one camera and one range topic; make the configuration agree")
        self.odometry_topic = configuration.odometry.topic
        self.range_topic = configuration.range_topics[0]
        self.picture_topic = configuration.camera[0].topic
        self._robot = configuration.robot.name
        beams = [math.radians(angle) for angle in simulation.beams_deg]
        self._angles_rad, self._limits_m = (beams[0], beams[-1]), (0.0, simulation.range_m)

    def messages(self, seen: Observation) -> Iterator[Message]:
        """The messages of one tick: odometry, ranges and, on ticks with one, a picture."""
        sample = OdometrySample(seen.t_ns, seen.odometry, seen.covariance)
        odometry = messages.odometry(sample, (float(seen.twist[0]), float(seen.twist[1])))
        yield self._message(self.odometry_topic, ODOMETRY_TYPE, seen, odometry)
        scan = messages.laser_scan(seen.t_ns, seen.ranges, self._angles_rad, self._limits_m)
        yield self._message(self.range_topic, RANGE_TYPE, seen, scan)
        if seen.picture is not None:
            picture = messages.compressed_image(seen.t_ns, seen.picture, quality=JPEG_QUALITY)
            yield self._message(self.picture_topic, PICTURE_TYPE, seen, picture)

    def _message(self, topic: str, type_name: str, seen: Observation, message: object) -> Message:
        return Message(f"/{self._robot}/{topic}", type_name, seen.t_ns, messages.encode(message))
