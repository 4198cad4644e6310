"""A robot and a learner whose messages a test says itself, of the real types, and the dashboard that looks on."""

import json
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from agents import messages, status, topics
from agents.agent import Agent
from agents.dashboard.collector import Collector
from agents.transport import Frames, State, Stream, announce, serve
from llrp_online.configuration import RobotConfiguration
from llrp_online.events import OdometrySample
from llrp_online.status import LearnerStatus

SECOND = 1_000_000_000
#: Between two poses, by the robot's clock.
TICK_NS = SECOND // 10


def keep_on(step: Callable[[], object], found: Callable[[], object], timeout_s: float = 20.0) -> None:
    """Ten steps a second, until what is waited for is found."""
    end_s = time.monotonic() + timeout_s
    while not found():
        assert time.monotonic() < end_s, "it never came"
        step()
        time.sleep(0.1)


class Robot:
    """A robot's messages, as a test says them."""

    def __init__(self, configuration: RobotConfiguration, agent: Agent) -> None:
        self.configuration, self.agent = configuration, agent
        self._streams: dict[str, Stream | Frames] = {}
        self.tick = 0

    def say(self, topic: str, message: object, *, frames: bool = False) -> None:
        kind = Frames if frames else Stream
        if topic not in self._streams:
            self._streams[topic] = kind(self.agent.session, self.agent.key(topic), message.__msgtype__)
        self._streams[topic].put(messages.encode(message))

    @property
    def t_ns(self) -> int:
        return SECOND + self.tick * TICK_NS

    def drive(self, x_m: float | None = None, y_m: float = 0.0, yaw_rad: float = 0.0) -> None:
        """A pose a tenth of a second after the one before; 2 cm further ahead, if not told where."""
        self.tick += 1
        x_m = 0.02 * self.tick if x_m is None else x_m
        sample = OdometrySample(self.t_ns, np.array([x_m, y_m, yaw_rad]))
        self.say(self.configuration.odometry.topic, messages.odometry(sample))

    def picture(self, value: int, camera: int = 0) -> None:
        """A grey picture, raw."""
        pixels = np.full((8, 8, 3), value, np.uint8)
        self.say(self.configuration.camera[camera].topic, messages.image(self.t_ns, pixels), frames=True)


class WatchedRobot(Robot):
    """A robot, and a dashboard's collector that hears it."""

    def __init__(self, configuration: RobotConfiguration, agent: Agent) -> None:
        super().__init__(configuration, agent)
        self.collector = Collector(agent, configuration)

    def causes(self) -> dict[str, str]:
        self.collector.tick()
        return {one.cause: f"{one.what} {one.do}" for one in self.collector.findings}


#: A tick of a learner's that has all it needs.
A_TICK = LearnerStatus(
    robot_s=0.1,
    frames=10,
    waiting=0,
    labelled=10,
    known=[70, 70],
    positives=[5, 5],
    remembered=10,
    steps=5,
    let_go=0.0,
    loss=0.1,
    version=1,
    version_age_s=0.1,
    rejected=0,
    bands=[],
    drift_events=0,
    drops={},
    paused=False,
    kept=[1],
)


class Learner:
    """What a learner says of itself, and its answers, as a test has them.

    Args:
        agent: of the robot.
        grows: what is added to its status with every tick; what does not count up stays as it is.
        answers: of its requests, by command; others are refused.
    """

    COUNTS = ("robot_s", "frames", "labelled", "remembered", "steps", "let_go", "rejected")

    def __init__(self, agent: Agent, grows: LearnerStatus = A_TICK, answers: dict[str, object] | None = None) -> None:
        self.grows, self.answers = grows, {} if answers is None else answers
        self._says = State(agent.session, agent.key(topics.LEARNER_STATUS), topics.STATUS_TYPE)
        self._presence = announce(agent.session, agent.robot, "learner")
        self._serves = serve(agent.session, agent.key(topics.LEARNER_COMMAND), self._answer)

    def close(self) -> None:
        self._serves.close()
        self._presence.undeclare()

    def say(self, tick: int) -> None:
        told = replace(self.grows, **{name: getattr(self.grows, name) * tick for name in self.COUNTS})
        told = replace(told, known=[n * tick for n in told.known], positives=[n * tick for n in told.positives])
        self._says.put(status.encode_learner(told, 0))

    def _answer(self, data: bytes) -> bytes:
        command = json.loads(data)["command"]
        return json.dumps({"command": command, "result": self.answers[command]}).encode()
