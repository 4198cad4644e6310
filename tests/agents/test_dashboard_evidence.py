"""What the dashboard makes of a robot's own messages: the causes that it names, and the word of its stop button."""

import threading
import time
from collections.abc import Generator
from dataclasses import asdict

import numpy as np
import pytest

from agents import messages, status, topics
from agents.agent import Agent
from agents.dashboard.button import StopButton
from agents.dashboard.collector import Collector
from agents.naming import naming_of
from agents.transport import Frames, State, Stream, free_endpoint, key, open_session, subscribe_stream
from llrp_online.configuration import RobotConfiguration, load
from llrp_online.configuration.running import Keys
from llrp_online.events import OdometrySample
from tests.agents import robots
from tests.agents.processes import until

pytestmark = pytest.mark.live

SECOND = 1_000_000_000


class Robot:
    """A robot's messages, as a test says them, and the dashboard that looks on."""

    def __init__(self, configuration: RobotConfiguration, agent: Agent) -> None:
        self.configuration, self._agent = configuration, agent
        self.collector = Collector(agent, configuration)
        self._streams: dict[str, Stream | Frames] = {}
        self.tick = 0

    def say(self, topic: str, message: object, *, frames: bool = False) -> None:
        kind = Frames if frames else Stream
        if topic not in self._streams:
            self._streams[topic] = kind(self._agent.session, self._agent.key(topic), message.__msgtype__)
        self._streams[topic].put(messages.encode(message))

    def drive(self, pose_m: float | None = None) -> None:
        """A pose a tenth of a second after the one before."""
        self.tick += 1
        x_m = 0.02 * self.tick if pose_m is None else pose_m
        sample = OdometrySample(SECOND + self.tick * SECOND // 10, np.array([x_m, 0.0, 0.0]))
        self.say(self.configuration.odometry.topic, messages.odometry(sample))

    def picture(self, value: int, camera: int = 0) -> None:
        pixels = np.full((8, 8, 3), value, np.uint8)
        self.say(self.configuration.camera[camera].topic, messages.image(self.tick * SECOND // 10, pixels), frames=True)

    def causes(self) -> dict[str, str]:
        self.collector.tick()
        return {one.cause: f"{one.what} {one.do}" for one in self.collector.findings}


@pytest.fixture
def robot(request: pytest.FixtureRequest) -> Generator[Robot]:
    configuration = load(f"configs/{request.param}.toml")
    with open_session(free_endpoint(), name="robot", naming=naming_of(configuration)) as session:
        robot = Robot(configuration, Agent(session, configuration.robot.name, threading.Event()))
        yield robot
        robot.collector.close()


def keep_on(step, found, timeout_s: float = 20.0) -> None:
    """Ten steps a second, until what is waited for is found."""
    end_s = time.monotonic() + timeout_s
    while not found():
        assert time.monotonic() < end_s, "it never came"
        step()
        time.sleep(0.1)


@pytest.mark.parametrize("robot", ["kobuki"], indirect=True)
def test_a_bumper_that_has_spoken_once_is_not_missed_and_one_that_never_has_is(robot):
    def step() -> None:
        robot.drive()
        robot.picture(robot.tick % 256)

    keep_on(step, lambda: "press each bumper once" in robot.causes().get("short range missing", ""))
    robot.say("events/bumper", robots.bumper_event(1, 0))
    keep_on(step, lambda: "short range missing" not in robot.causes())
    begin = robot.tick
    keep_on(step, lambda: robot.tick > begin + 30 and robot.causes() is not None)
    assert set(robot.causes()) == {"no learner"}


@pytest.mark.parametrize("robot", ["kobuki"], indirect=True)
def test_a_raw_picture_that_stays_while_the_robot_drives_is_noticed(robot):
    def step() -> None:
        robot.drive()
        robot.picture(7)

    topic = robot.configuration.camera[0].topic
    keep_on(step, lambda: topic in robot.causes().get("camera frozen", ""))


@pytest.mark.parametrize("robot", ["thymio"], indirect=True)
def test_what_comes_and_cannot_be_used_is_told_from_standing_still(robot):
    def step() -> None:
        robot.drive(float("nan"))
        robot.say("range", messages.flag(True))

    keep_on(step, lambda: {"odometry unusable", "short range unusable"} <= set(robot.causes()))
    said = robot.causes()
    assert "odom: " in said["odometry unusable"]
    assert "range: no `ranges[4]` in a std_msgs/msg/Bool" in said["short range unusable"]
    assert "llrp check --live" in said["odometry unusable"]
    assert "standing still" not in said
    keep_on(robot.drive, lambda: "odometry unusable" not in robot.causes())


@pytest.mark.parametrize("robot", ["thymio"], indirect=True)
def test_a_thymio_that_keeps_frozen_pictures_back_says_why_none_come(robot):
    says = State(robot._agent.session, key("thymio", topics.ROBOT_STATUS), topics.STATUS_TYPE)
    says.put(status.encode("robot", 0, asdict(status.ThymioStatus(1.0, 0.1, "connected", "frozen for 3 s: unplug it"))))
    keep_on(robot.drive, lambda: "frozen for 3 s: unplug it" in robot.causes().get("camera missing", ""))


@pytest.mark.parametrize("mapping", ["plain", "ros2-zenoh", "ros2-dds"])
@pytest.mark.parametrize("name", ["thymio", "turtlebot4"])
def test_stop_is_said_in_the_type_that_the_robot_takes(name, mapping):
    configuration = load(f"configs/{name}.toml")
    keys = Keys.model_validate({**configuration.keys.model_dump(), "mapping": mapping})
    configuration = configuration.model_copy(update={"keys": keys})
    heard: list[tuple[str, tuple[float, float]]] = []
    with open_session(free_endpoint(), name="robot", naming=naming_of(configuration)) as session:
        agent = Agent(session, configuration.robot.name, threading.Event())
        subscribe_stream(
            session,
            agent.key(topics.COMMAND),
            lambda m: heard.append((m.type, messages.read_twist(messages.decode(m.type, m.data)))),
        )
        button = StopButton(agent, configuration, lambda: 5 * SECOND)
        button.press(True)
        button.insist()
        until(lambda: len(heard) == 2, "two commands")
    expected = topics.STAMPED_COMMAND_TYPE if name == "turtlebot4" else topics.COMMAND_TYPE
    assert heard == [(expected, (0.0, 0.0))] * 2
