"""Recordings to labelled frames: what `label`, `train` and `evaluate` share."""

import logging
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from agents.intake import Intake
from agents.progress import Share, nobody
from llrp_online.configuration import RobotConfiguration
from llrp_online.events import Event
from llrp_online.labeller import Labeller
from replay.recording import Message, Recording, read
from replay.updates import Updates

_LOG = logging.getLogger(__name__)
#: Messages decoded together, then labelled together: each kind of work finds the processor's cache as it left it.
_AT_ONCE = 96


@dataclass(frozen=True, eq=False)
class LabelledFrame:
    """A frame whose window has closed.

    Attributes:
        t_ns: the sensor's time.
        picture: (H, W, C) uint8.
        labels: (T, S) int8: 1, 0, -1 unknown.
        weight: (T, S) float32.
    """

    t_ns: int
    picture: NDArray[np.uint8]
    labels: NDArray[np.int8]
    weight: NDArray[np.float32]


class MissingTopicsError(ValueError):
    """A recording lacks topics that the configuration names."""


def messages_of(path: Path, intake: Intake) -> Iterator[tuple[Message, float]]:
    """The messages of a recording, each with the share of its time that is over.

    MissingTopicsError at its end if the configuration's topics never came.
    """
    yield from shares(read(path))
    _must_have_come(path, intake)


def shares(recording: Recording) -> Iterator[tuple[Message, float]]:
    """The messages of a recording, each with the share of its time that is over."""
    first_ns: int | None = None
    for message in recording:
        first_ns = message.log_ns if first_ns is None else first_ns
        yield message, _share(recording, first_ns, message)


def _share(recording: Recording, first_ns: int, message: Message) -> float:
    return (message.log_ns - first_ns) / max((recording.report.last_ns or 0) - first_ns, 1)


def _events_of(path: Path, intake: Intake, told: Share) -> Iterator[list[Event]]:
    """What the messages of a recording mean, many at once; MissingTopicsError as `messages_of`."""
    recording, first_ns = read(path), None
    while messages := list(islice(recording, _AT_ONCE)):
        first_ns = messages[0].log_ns if first_ns is None else first_ns
        told(_share(recording, first_ns, messages[-1]))
        events = (intake.events(message.topic, message.type, message.data, message.log_ns) for message in messages)
        yield [event for found in events for event in found]
    _must_have_come(path, intake)


def _must_have_come(path: Path, intake: Intake) -> None:
    missing = intake.missing()
    if missing is not None:
        raise MissingTopicsError(f"{path}: {missing}")


def labelled_frames(configuration: RobotConfiguration, path: Path, told: Share = nobody) -> Iterator[LabelledFrame]:
    """The frames of one recording that have a pose, in order of time, each when its window has closed.

    `told` hears how much of the recording is over.
    """
    pictures: dict[int, NDArray[np.uint8]] = {}
    for updates in labels_of(configuration, path, pictures.__setitem__, told):
        for update in updates:
            picture = pictures.pop(update.frame_id)
            if update.posed:
                yield LabelledFrame(update.t_ns, picture, update.labels, update.weight)


def labels_of(
    configuration: RobotConfiguration,
    path: Path,
    on_frame: Callable[[int, NDArray[np.uint8]], None] = lambda _id, _picture: None,
    told: Share = nobody,
) -> Iterator[Updates]:
    """The labels of one recording's frames, in order of time, many at once, each when its window has closed.

    `on_frame` is called with the id and the picture of each frame that comes in; nobody else keeps it.
    `told` hears how much of the recording is over.
    """
    intake, labeller = Intake(configuration), Labeller(configuration, only_closed=True)
    for events in _events_of(path, intake, told):
        for event in events:
            outcome = labeller.take(event)
            for frame in outcome.frames:
                on_frame(frame.frame_id, frame.picture)
            if outcome.updates:
                yield outcome.updates
    yield labeller.end_trajectory()
    report_drops(path, intake.drops + labeller.drops)


def report_drops(source: Path | str, drops: Counter[str]) -> None:
    """Say what could not be used."""
    for what, count in sorted(drops.items()):
        _LOG.warning("%s: dropped %d: %s", source, count, what)
