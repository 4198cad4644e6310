"""The frames of a recording as the network sees them, with neither poses nor labels."""

from collections.abc import Iterable, Iterator
from pathlib import Path

from agents.intake import Intake
from agents.offline import report_drops
from llrp_online.configuration import RobotConfiguration
from llrp_online.events import Picture
from llrp_online.synchroniser import Frame, Synchroniser
from replay.recording import Message, read


def frames_in(configuration: RobotConfiguration, intake: Intake, messages: Iterable[Message]) -> Iterator[Frame]:
    """The frames that messages make, which `intake` takes in."""
    synchroniser = Synchroniser(len(configuration.camera), configuration.robot.camera_sync_s)
    for message in messages:
        for event in intake.events(message.topic, message.type, message.data, message.log_ns):
            if isinstance(event, Picture):
                yield from synchroniser.add(event)


def frames_of(configuration: RobotConfiguration, path: Path) -> Iterator[Frame]:
    """Every frame in order of its coming; ValueError at the end if there was none."""
    intake, count = Intake(configuration), 0
    for frame in frames_in(configuration, intake, read(path)):
        count += 1
        yield frame
    report_drops(path, intake.drops)
    if not count:
        raise ValueError(f"{path}: not one usable frame; expected some. See `llrp check {path}` for the cause")
