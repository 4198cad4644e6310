"""The frames of a recording as the network sees them, with neither poses nor labels."""

from collections.abc import Iterator
from pathlib import Path

from agents.intake import Intake
from agents.offline import report_drops
from llrp_online.configuration import RobotConfiguration
from llrp_online.events import Picture
from llrp_online.synchroniser import Frame, Synchroniser
from replay.recording import read


def frames_of(configuration: RobotConfiguration, path: Path) -> Iterator[Frame]:
    """Every frame in order of its coming; ValueError at the end if there was none."""
    intake = Intake(configuration)
    synchroniser = Synchroniser(len(configuration.camera), configuration.robot.camera_sync_s)
    count = 0
    for message in read(path):
        for event in intake.events(message.topic, message.type, message.data, message.log_ns):
            if isinstance(event, Picture):
                for frame in synchroniser.add(event):
                    count += 1
                    yield frame
    report_drops(path, intake.drops)
    if not count:
        raise ValueError(f"{path}: not one usable frame; expected some. See `llrp check {path}` for the cause")
