"""The simulated robot on the bus: obeys the newest command, ticks at its pace, says what it senses.

Its watchdog is its own: a command older than `transport.stale_s`, by the sensors' clock, means stop. So does a person's
word, whatever is commanded.
"""

import math
import threading
import time
from dataclasses import asdict

import numpy as np

from agents import messages, status, topics
from agents.agent import Agent
from agents.halt import Halt
from agents.messages import MessageError
from agents.robots.simulated import Observation, SimulatedRobot
from agents.robots.wire import PICTURE_TYPE, RANGE_TYPE, Wire
from agents.topics import ODOMETRY_TYPE
from agents.transport import Frames, Publisher, Received, State, Stream, subscribe_latest
from llrp_online.configuration import RobotConfiguration

#: A robot that fell behind its pace by more than this does not hurry to make up for it.
_LONGEST_DELAY_S = 0.2
_STATUS_EVERY_TICKS = 20


class LiveRobot:
    """A simulated robot as an agent.

    Args:
        agent: on whose session it lives.
        configuration: the robot's.
        robot: what is driven.
        speed: of its time, beside the wall's; inf: as fast as it goes.
    """

    def __init__(self, agent: Agent, configuration: RobotConfiguration, robot: SimulatedRobot, speed: float) -> None:
        if not speed > 0:
            raise ValueError(f"speed: expected a number above 0 or inf, got {speed}")
        self._wire = Wire(configuration)
        self._robot, self._agent = robot, agent
        self._tick_s = 0.0 if math.isinf(speed) else 1 / (configuration.simulated().rate_hz * speed)
        self._stale_ns = round(configuration.transport.stale_s * 1e9)
        session, key = agent.session, agent.key
        self._publishers: dict[str, Publisher] = {
            self._wire.odometry_topic: Stream(session, key(self._wire.odometry_topic), ODOMETRY_TYPE),
            self._wire.range_topic: Stream(session, key(self._wire.range_topic), RANGE_TYPE),
            self._wire.picture_topic: Frames(session, key(self._wire.picture_topic), PICTURE_TYPE),
        }
        self._status = State(session, key(topics.ROBOT_STATUS), topics.STATUS_TYPE)
        self._turn = threading.Lock()
        self._command = (0.0, 0.0)
        self._command_ns = 0
        self._now_ns = 0
        self._start_ns: int | None = None
        self._metres = 0.0
        self._last_xy = np.zeros(2)
        self._halt = Halt(session, agent.robot)
        self._subscription = subscribe_latest(session, key(topics.COMMAND), self._obey)

    @property
    def status(self) -> status.RobotStatus:
        """What it says of itself."""
        start_ns = self._now_ns if self._start_ns is None else self._start_ns
        lived_s = (self._now_ns - start_ns) * 1e-9
        return status.RobotStatus(lived_s, self._robot.collisions, self._metres, self._halt.holds)

    def run(self, seconds: float) -> None:
        """Live for so many seconds of its own time, or until told to stop."""
        ticks, due_s = 0, time.monotonic()
        while not self._agent.stop.is_set() and self.status.robot_s < seconds:
            self._tick()
            ticks += 1
            if ticks % _STATUS_EVERY_TICKS == 0:
                self._say_status()
            due_s = max(due_s + self._tick_s, time.monotonic() - _LONGEST_DELAY_S)
            self._agent.stop.wait(max(due_s - time.monotonic(), 0.0))
        self._subscription.close()
        self._halt.close()
        self._say_status()

    def _tick(self) -> None:
        with self._turn:
            fresh = self._now_ns - self._command_ns <= self._stale_ns
            command = self._command if fresh and not self._halt.holds else (0.0, 0.0)
        seen = self._robot.step(*command)
        self._now_ns = seen.t_ns
        self._measure(seen)
        for message in self._wire.messages(seen):
            self._publishers[message.topic.removeprefix(f"/{self._agent.robot}/")].put(message.data)

    def _measure(self, seen: Observation) -> None:
        if self._start_ns is None:
            self._start_ns, self._last_xy = seen.t_ns, seen.true_pose[:2]
        self._metres += float(np.hypot(*(seen.true_pose[:2] - self._last_xy)))
        self._last_xy = seen.true_pose[:2]

    def _say_status(self) -> None:
        self._status.put(status.encode("robot", self._now_ns, asdict(self.status)))

    def _obey(self, message: Received) -> None:
        try:
            command = messages.read_twist(messages.decode(message.type, message.data))
        except MessageError:
            return  # what is no command cannot move the robot; silence stops it
        with self._turn:
            self._command, self._command_ns = command, self._now_ns
