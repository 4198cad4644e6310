"""The simulated robot of a configuration, and its drive to a file in virtual time: the same bytes every time."""

from pathlib import Path

from agents import messages
from agents.behaviours import controller
from agents.progress import track
from agents.robots.simulated import Scenario, SimulatedRobot
from agents.robots.wire import Wire
from agents.rollout import rollout
from llrp_online.configuration import RobotConfiguration
from replay.recording import Writer


def simulated_robot(
    configuration: RobotConfiguration, scenario: Scenario, seed: int, *, camera: bool = True
) -> SimulatedRobot:
    """The simulated robot of a configuration in a scenario; ValueError without [simulation]."""
    height, width, _ = configuration.picture_shape
    picture = (height, width) if camera else None
    return SimulatedRobot(configuration.simulated(), scenario, seed, picture)


def record_drive(
    configuration: RobotConfiguration,
    scenario: Scenario,
    seed: int,
    minutes: float,
    output: Path,
    behaviour: str = "explore",
) -> int:
    """Drive the simulated robot in virtual time and record what it senses; the messages written."""
    robot, wire = simulated_robot(configuration, scenario, seed), Wire(configuration)
    drive = rollout(robot, controller(behaviour, configuration, seed), configuration, 60 * minutes)
    output.parent.mkdir(parents=True, exist_ok=True)
    with Writer(output, messages.definition) as writer:
        for seen in track(drive, "driving", round(60 * minutes * configuration.simulated().rate_hz)):
            for message in wire.messages(seen):
                writer.write(message)
    return writer.messages
