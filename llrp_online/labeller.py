"""From sensor events to labelled frames: the synchroniser and the trajectory store behind one door.

The learner lives on it, and so does all that works offline (`llrp label`, `train`, `evaluate`): one way to label.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from llrp_online.configuration import RobotConfiguration
from llrp_online.events import Event, OdometrySample, Reading
from llrp_online.synchroniser import Synchroniser
from replay.trajectory import TrajectoryStore
from replay.updates import Updates

#: What the synchroniser's arrays are called by beside the store's.
_CAMERAS = "cameras."
_NO_PICTURE = np.empty(0, np.uint8)


@dataclass(frozen=True, eq=False)
class NewFrame:
    """A frame that has just come in.

    Attributes:
        frame_id: counts up from the labeller's first.
        t_ns: the sensor's time.
        picture: (H, W, C) uint8.
    """

    frame_id: int
    t_ns: int
    picture: NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Outcome:
    """What one event led to: frames that came in, then what became known of any frame."""

    frames: list[NewFrame]
    updates: Updates


class Labeller:
    """Events in, frames and label updates out.

    Args:
        configuration: the robot's.
        first_id: of the frames to come; above every id a restored memory holds.
        only_closed: tell of each frame once, when its window has closed, and keep no picture: an `Outcome` shows each
            as it comes in.
        explain_ns: time of a frame to explain when it closes; see `TrajectoryStore.explained`.
    """

    def __init__(
        self,
        configuration: RobotConfiguration,
        first_id: int = 0,
        *,
        only_closed: bool = False,
        explain_ns: int | None = None,
    ) -> None:
        streams = configuration.streams
        # None: the stream speaks for all sensors.
        self._streams = {
            topic: (index, None if len(members) == len(configuration.sensors) else members)
            for index, (topic, members) in enumerate(streams.items())
        }
        odometry = configuration.odometry
        self._synchroniser = Synchroniser(len(configuration.camera), configuration.robot.camera_sync_s)
        self.store = TrajectoryStore(
            configuration.targets.build(),
            list(streams.values()),
            configuration.labels.rule(),
            odometry.limits(),
            odometry.noise(),
            budget_bytes=round(configuration.memory.store_mb * 1e6),
            only_closed=only_closed,
            explain_ns=explain_ns,
        )
        self._only_closed, self._trust_covariance = only_closed, odometry.trust_covariance
        self.next_id = first_id

    @property
    def drops(self) -> Counter[str]:
        """What could not be used, and how often."""
        drops = Counter(self.store.drops)
        if self._synchroniser.unmatched:
            drops["camera: no picture of the other cameras near enough in time"] += self._synchroniser.unmatched
        return drops

    def take(self, event: Event) -> Outcome:
        """Take in one event."""
        if isinstance(event, OdometrySample):
            covariance = event.covariance if self._trust_covariance else None
            return Outcome([], self.store.add_odometry(event.t_ns, event.pose, covariance))
        if isinstance(event, Reading):
            stream, sensors = self._streams[event.topic]
            bits = event.bits if sensors is None else event.bits[sensors]
            return Outcome([], self.store.add_reading(event.t_ns, stream, bits))
        frames: list[NewFrame] = []
        updates: list[Updates] = []
        for frame in self._synchroniser.add(event):
            frames.append(NewFrame(self.next_id, frame.t_ns, frame.picture))
            kept = _NO_PICTURE if self._only_closed else frame.picture
            updates.append(self.store.add_frame(self.next_id, frame.t_ns, kept))
            self.next_id += 1
        return Outcome(frames, Updates.joined(updates) if updates else self.store.nothing)

    def state(self) -> dict[str, NDArray[Any]]:
        """All that waits, as arrays for `restore`."""
        cameras = {f"{_CAMERAS}{name}": array for name, array in self._synchroniser.state().items()}
        return {**self.store.state(), **cameras}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Wait for what `state` waited for."""
        self.store.restore({name: array for name, array in state.items() if not name.startswith(_CAMERAS)})
        cameras = {name: array for name, array in state.items() if name.startswith(_CAMERAS)}
        self._synchroniser.restore({name.removeprefix(_CAMERAS): array for name, array in cameras.items()})

    def end_trajectory(self) -> Updates:
        """A new recording, or a robot that was carried off: every frame closes."""
        self._synchroniser.clear()
        return self.store.end_trajectory()
