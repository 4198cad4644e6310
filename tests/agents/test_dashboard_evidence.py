"""What the dashboard makes of a robot's own messages: the causes that it names, and the word of its stop button."""

import threading
from collections.abc import Generator
from dataclasses import asdict

import pytest

from agents import messages, status, topics
from agents.agent import Agent
from agents.dashboard.button import StopButton
from agents.naming import naming_of
from agents.transport import State, free_endpoint, key, open_session, subscribe_stream
from llrp_online.configuration import load
from llrp_online.configuration.running import Keys
from tests.agents import robots
from tests.agents.processes import until
from tests.agents.scripted import SECOND, WatchedRobot, keep_on

pytestmark = pytest.mark.live


@pytest.fixture
def robot(request: pytest.FixtureRequest) -> Generator[WatchedRobot]:
    configuration = load(f"configs/{request.param}.toml")
    with open_session(free_endpoint(), name="robot", naming=naming_of(configuration)) as session:
        robot = WatchedRobot(configuration, Agent(session, configuration.robot.name, threading.Event()))
        yield robot
        robot.collector.close()


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
    says = State(robot.agent.session, key("thymio", topics.ROBOT_STATUS), topics.STATUS_TYPE)
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
