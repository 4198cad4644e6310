"""A recording as a robot: its sensor messages, published at the pace they were recorded at, or another.

Only the topics that the configuration takes in are played: predictions, labels and commands in a recording were made by
agents whose place others take now. It obeys no commands; where it drives was decided long ago.
"""

import logging
import math
import threading
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

from agents.intake import Missing
from agents.offline import shares
from agents.progress import Share, nobody
from agents.topics import relative_topic
from agents.transport import Frames, Publisher, Session, Stream, key
from llrp_online.configuration import RobotConfiguration
from replay.recording import Message, read

logger = logging.getLogger(__name__)

# Pictures put without a pause find the link busy and are dropped, nearly all of them; after this they get through.
_BREATH_S = 0.002


def schedule(messages: Iterable[Message], speed: float) -> Iterator[tuple[float, Message]]:
    """Each message with when it is due [s] after the first; `speed` 2.0 is twice the sensors' pace, inf at once.

    >>> parts = [Message("/odom", "nav_msgs/msg/Odometry", t_ns, b"") for t_ns in (10**9, 3 * 10**9)]
    >>> [due_s for due_s, _ in schedule(parts, 4.0)]
    [0.0, 0.5]
    """
    if not speed > 0:
        raise ValueError(f"speed: expected a number above 0 (inf: as fast as it goes), got {speed}")
    first_ns: int | None = None
    for message in messages:
        first_ns = message.log_ns if first_ns is None else first_ns
        yield (message.log_ns - first_ns) / 1e9 / speed, message


class Playback:
    """Plays one recording to the agents of a robot.

    Speed 1.0 is the sensors' pace, inf as fast as the link takes the pictures: some hundreds a second.

    Attributes:
        played: messages published so far.
        late_s: how far behind its schedule it is; 0 at the speed inf.
    """

    def __init__(
        self, session: Session, configuration: RobotConfiguration, path: str | Path, speed: float = 1.0
    ) -> None:
        self.played = 0
        self.late_s = 0.0
        self._robot = configuration.robot.name
        self._speed = speed
        self._path = Path(path)
        self._messages = read(path)
        kinds = dict.fromkeys([configuration.odometry.topic, *configuration.range_topics], Stream)
        kinds |= dict.fromkeys([camera.topic for camera in configuration.camera], Frames)
        # Declared before anything is played, so that readers are known when it begins; types come with the messages.
        self._publishers: dict[str, Publisher] = {}
        for topic, kind in kinds.items():
            name = relative_topic(self._robot, topic)
            self._publishers[name] = kind(session, key(self._robot, name), "")
        self._came: dict[str, str] = {}

    def run(self, stop: threading.Event, told: Share = nobody) -> Missing | None:
        """Plays until the end, and says what it lacked of the configuration's topics, or until `stop` is set.

        `told` hears how much of the recording is over.
        """
        begin_s = time.monotonic()
        for due_s, message in schedule(self._watched(told), self._speed):
            wait_s = due_s - (time.monotonic() - begin_s)
            self.late_s = max(0.0, -wait_s) if math.isfinite(self._speed) else 0.0
            if stop.wait(wait_s) if wait_s > 0 else stop.is_set():
                return None
            publisher = self._play(message)
            if isinstance(publisher, Frames) and math.isinf(self._speed):
                stop.wait(_BREATH_S)
        topics = tuple(name for name, publisher in self._publishers.items() if not publisher.sent)
        missing = Missing(topics, self._came) if topics else None
        if missing is not None:
            logger.warning("%s: %s", self._path, missing)
        return missing

    def close(self) -> None:
        """Publish no more. Closing the session does the same."""
        for publisher in self._publishers.values():
            publisher.close()

    def _watched(self, told: Share) -> Iterator[Message]:
        for message, share in shares(self._messages):
            told(share)
            yield message

    def _play(self, message: Message) -> Publisher | None:
        self._came.setdefault(message.topic, message.type)
        publisher = self._publishers.get(relative_topic(self._robot, message.topic))
        if publisher is not None:
            publisher.put(message.data, message.type)
            self.played += 1
        return publisher
