"""The Thymio on the bus: the messages of the simulated one, from a real robot and a real camera.

Commands go straight on to the firmware, each with its life, `transport.stale_s`: the watchdog runs on the robot, and
holds whatever dies at this end. A robot that is lost, cable pulled or switched off, is looked for until it is back.
"""

import logging
import math
import time
from collections import Counter
from contextlib import suppress
from dataclasses import asdict

from agents import messages, status, topics
from agents.agent import Agent
from agents.halt import Halt
from agents.messages import MessageError
from agents.robots.thymio import camera
from agents.robots.thymio.clock import BeatClock, HostClock, age_ns
from agents.robots.thymio.firmware import Firmware, Report
from agents.robots.thymio.link import Link, LinkError
from agents.robots.thymio.proximity import ANGLES_RAD, REACH_M, ranges_m
from agents.robots.thymio.wheels import Wheels
from agents.robots.wire import JPEG_QUALITY, ODOMETRY_TYPE, PICTURE_TYPE, RANGE_TYPE
from agents.transport import Frames, Received, State, Stream, subscribe_latest
from llrp_online.configuration import RobotConfiguration
from llrp_online.events import OdometrySample

logger = logging.getLogger(__name__)

CONNECTED = "connected"
_RETRY_S = 1.0
_STATUS_S = 1.0


class LiveThymio:
    """A real Thymio as an agent.

    Args:
        agent: on whose session it lives.
        configuration: the robot's; its first range topic and its only camera are used.
    """

    def __init__(self, agent: Agent, configuration: RobotConfiguration) -> None:
        if len(configuration.camera) != 1 or len(configuration.range_topics) != 1:
            raise ValueError("a Thymio has one camera and one range topic; make the configuration agree")
        self._agent, self._settings = agent, configuration.thymio
        self._stale_s = configuration.transport.stale_s
        self._gap_s = max(_RETRY_S, configuration.odometry.max_gap_s)
        session, key = agent.session, agent.key
        self._odometry = Stream(session, key(configuration.odometry.topic), ODOMETRY_TYPE)
        self._ranges = Stream(session, key(configuration.range_topics[0]), RANGE_TYPE)
        self._pictures = Frames(session, key(configuration.camera[0].topic), PICTURE_TYPE)
        self._status = State(session, key(topics.ROBOT_STATUS), topics.STATUS_TYPE)
        self._clock = HostClock()
        self._wheels = Wheels(self._settings)
        size = configuration.camera[0].width, configuration.camera[0].height
        self._camera = camera.Camera(self._settings, size, self._clock, self._show)
        self._firmware: Firmware | None = None
        self._link = "looking for it"
        self._told: dict[str, str] = {}
        self._felt = 0
        self._since_ns = self._clock.now_ns()
        self._said_s = -math.inf
        self.drops: Counter[str] = Counter()
        self._halt = Halt(session, agent.robot, self._halted)

    @property
    def status(self) -> status.ThymioStatus:
        """What it says of itself."""
        robot_s = (self._clock.now_ns() - self._since_ns) * 1e-9
        drops, stopped = dict(self.drops), self._halt.holds
        return status.ThymioStatus(robot_s, self._wheels.metres, self._link, self._camera.state, drops, stopped)

    def run(self, seconds: float) -> None:
        """Live for so many seconds, or until told to stop; then stand still."""
        subscription = subscribe_latest(self._agent.session, self._agent.key(topics.COMMAND), self._obey)
        self._camera.start()
        try:
            while not self._is_over(seconds):
                try:
                    with Link(self._settings.port) as link:
                        self._live(link, seconds)
                except LinkError as error:
                    self._firmware, self._link = None, str(error)
                    self._report_state()
                    # Longer than odometry may be silent: the robot may be carried meanwhile, and the trajectory ends.
                    self._agent.stop.wait(self._gap_s)
        finally:
            subscription.close()
            self._halt.close()
            self._camera.close()
            self._report_state()

    def _is_over(self, seconds: float) -> bool:
        return self._agent.stop.is_set() or self.status.robot_s >= seconds

    def _live(self, link: Link, seconds: float) -> None:
        firmware, clock = Firmware(link), BeatClock()
        self._wheels.restart()
        self._felt = 0  # where the firmware begins, before its sensors were read
        self._firmware, self._link = firmware, CONNECTED
        try:
            while not self._is_over(seconds):
                report = firmware.report()
                self._tell(report, clock.stamp_ns(report.beats, self._clock.now_ns()))
                if time.monotonic() - self._said_s > _STATUS_S:
                    self._report_state()
        finally:
            self._firmware = None
            firmware.halt()

    def _tell(self, report: Report, t_ns: int) -> None:
        moved = self._wheels.add(report)
        if moved is None:
            return
        sample = OdometrySample(t_ns, moved.pose, moved.covariance)
        self._odometry.put(messages.encode(messages.odometry(sample, (moved.speed_m_s, moved.turn_rad_s))))
        if report.felt_beats != self._felt:  # the sensors are read less often than the wheels
            self._felt = report.felt_beats
            felt_ns = t_ns - age_ns(report.beats, report.felt_beats)
            ranges = ranges_m(report.proximity, self._settings)
            self._ranges.put(messages.encode(messages.laser_scan(felt_ns, ranges, ANGLES_RAD, (0.0, REACH_M))))

    def _show(self, t_ns: int, pixels: camera.Pixels) -> None:
        self._pictures.put(messages.encode(messages.compressed_image(t_ns, pixels, quality=JPEG_QUALITY)))

    def _obey(self, message: Received) -> None:
        try:
            command = messages.read_twist(messages.decode(message.type, message.data))
        except MessageError as error:
            self.drops[f"{topics.COMMAND}: {error}"] += 1  # what is no command cannot move the robot
        else:
            self._drive((0.0, 0.0) if self._halt.holds else command)

    def _halted(self) -> None:
        """A person has pressed Stop, or let go of it: until the next command it stands."""
        self._drive((0.0, 0.0))

    def _drive(self, command: tuple[float, float]) -> None:
        firmware = self._firmware
        # Whoever waits for reports notices a line that is lost too, and does something about it.
        with suppress(LinkError):
            if firmware is not None:
                firmware.drive(*self._wheels.targets(*command), self._stale_s)

    def _report_state(self) -> None:
        self._said_s = time.monotonic()
        self._status.put(status.encode("robot", self._clock.now_ns(), asdict(self.status)))
        self._say("Thymio", self._link, self._link == CONNECTED)
        self._say("camera", self._camera.state, self._camera.state in (status.CAMERA_LIVE, status.CAMERA_NONE))

    def _say(self, what: str, state: str, fine: bool) -> None:
        """To whoever watches the terminal, when it is another kind of state than before."""
        kind = "".join(letter for letter in state if not letter.isdigit())  # seconds go on, what is wrong stays
        if kind != self._told.get(what):
            self._told[what] = kind
            logger.log(logging.INFO if fine else logging.WARNING, "%s: %s", what, state)
