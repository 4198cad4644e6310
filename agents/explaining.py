"""`llrp explain`: one frame of a recording, and why each of its labels is what it is.

The labels are those that `llrp label` writes: the same labeller reads the same messages in the same order.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from agents.frames import frames_in
from agents.intake import Intake
from agents.offline import messages_of
from agents.progress import Share, share_of
from llrp_online.configuration import RobotConfiguration
from llrp_online.labeller import Labeller
from replay.explanation import Explanation
from replay.recording import Message


def explain_at(configuration: RobotConfiguration, path: Path, at_s: float) -> tuple[Explanation, float]:
    """The frame nearest to `at_s` seconds after the recording's first, and how many seconds after it that is."""
    first_ns, t_ns = _nearest_frame(configuration, path, at_s)
    intake, labeller = Intake(configuration), Labeller(configuration, only_closed=True, explain_ns=t_ns)
    with share_of("labelling") as told:
        for message in _telling(messages_of(path, intake), told):
            for event in intake.events(message.topic, message.type, message.data, message.log_ns):
                labeller.take(event)
            if labeller.store.explained is not None:
                break
        else:
            labeller.end_trajectory()
    if labeller.store.explained is None:
        raise ValueError(
            f"{path}: the frame {(t_ns - first_ns) * 1e-9:.2f} s after the first came later than "
            "odometry.max_delay_s allows and was dropped; name another, or raise that key"
        )
    return labeller.store.explained, (t_ns - first_ns) * 1e-9


def _nearest_frame(configuration: RobotConfiguration, path: Path, at_s: float) -> tuple[int, int]:
    """Times of the first frame, and of the one nearest to `at_s` after it."""
    intake = Intake(configuration)
    late_ns = round(configuration.odometry.max_delay_s * 1e9)
    found: tuple[int, int] | None = None
    with share_of("looking for the frame") as told:
        for frame in frames_in(configuration, intake, _telling(messages_of(path, intake), told)):
            first_ns, nearest_ns = found or (frame.t_ns, frame.t_ns)
            wanted_ns = first_ns + round(at_s * 1e9)
            found = first_ns, min(nearest_ns, frame.t_ns, key=lambda t_ns: abs(t_ns - wanted_ns))
            if frame.t_ns > wanted_ns + late_ns:
                break
    if found is None:
        raise ValueError(f"{path}: it has no frame; see `llrp check {path}` for the cause")
    return found


def _telling(messages: Iterator[tuple[Message, float]], told: Share) -> Iterator[Message]:
    for message, share in messages:
        told(share)
        yield message


def as_json(configuration: RobotConfiguration, explanation: Explanation) -> dict[str, Any]:
    """An explanation with the names and places that its arrays speak of."""
    return {
        "targets": configuration.targets.build().poses.tolist(),
        "sensors": configuration.sensors,
        "topics": [sensor.topic for sensor in configuration.short_range],
        **explanation.as_json(),
    }
