"""Everything a robot and its agents say, to a recording: the bus is never kept waiting, and what is lost is counted.

Log times are the sensors' clock at the moment of receipt: the newest stamp that a sensor's message has brought. So a
recording of a simulation that ran ten times as fast as the clock on the wall plays back at the robot's own pace, and
predictions, labels and commands stand between the sensor messages they came between.
"""

import logging
import threading
from collections import Counter
from pathlib import Path
from queue import SimpleQueue

from agents import messages
from agents.topics import ODOMETRY_TYPE
from agents.transport import Received, Session, subscribe_all, topic
from replay.closing import Closing
from replay.recording import Message, RecordingError, Writer

logger = logging.getLogger(__name__)

_QUEUE_BYTES = 64 * 1024 * 1024
_WAITING = 1000  # messages that may come before the first sensor speaks
_RESET_NS = 1_000_000_000  # a stamp this far behind its predecessor is a clock that was set, not a late message
_APART_NS = 10_000_000_000  # sensors whose stamps differ by this have clocks of their own
_CLOSE_S = 5.0


class SensorClock:
    """The sensors' time, never going back, from the stamps of their messages.

    A topic whose clock is set back, or was never the others', is shifted so that its messages keep their order of
    arrival and their pace. Stamps of what agents compute (predictions, labels) are those of frames long past, and do
    not count.

    >>> clock = SensorClock()
    >>> scan = messages.laser_scan(7_000, [1.0], (0.0, 0.0), (0.0, 4.0))
    >>> clock.log_ns("range", "sensor_msgs/msg/LaserScan", messages.encode(scan))
    7000
    """

    def __init__(self) -> None:
        self._now_ns: int | None = None  # no sensor has spoken yet
        self._shift_ns: dict[str, int] = {}
        self._last_ns: dict[str, int] = {}

    def start(self, now_ns: int) -> None:
        """Sets it where no sensor speaks; those that do later are shifted to it."""
        self._now_ns = now_ns

    def log_ns(self, topic: str, type_name: str, data: bytes) -> int | None:
        """The time at which this message came; None as long as no sensor has said."""
        stamp_ns = messages.stamp_ns(type_name, data) if _is_sensor(type_name) else None
        if stamp_ns is None:
            return self._now_ns
        now_ns = stamp_ns if self._now_ns is None else self._now_ns
        begins = topic not in self._last_ns and abs(stamp_ns - now_ns) > _APART_NS
        if begins or stamp_ns < self._last_ns.get(topic, stamp_ns) - _RESET_NS:
            self._shift_ns[topic] = now_ns - stamp_ns
        self._last_ns[topic] = stamp_ns
        self._now_ns = max(0, now_ns, stamp_ns + self._shift_ns.get(topic, 0))
        return self._now_ns


class Recorder(Closing):
    """Records all topics of a robot until it is closed.

    Attributes:
        path: the recording, a new file.
        messages: written so far.
        drops: messages lost for want of room or by the disk, by topic.
        error: what the disk said, if it refused; nothing is written after that.
    """

    def __init__(self, session: Session, robot: str, path: str | Path, queue_bytes: int = _QUEUE_BYTES) -> None:
        self.path = Path(path)
        self.drops: Counter[str] = Counter()
        self.error: RecordingError | None = None
        self._robot = robot
        self._writer = Writer(path, messages.definition)
        self._clock = SensorClock()
        self._before_clock: list[Received] = []
        self._oldest_ns = self._newest_ns = 0
        self._free_bytes = queue_bytes
        self._lock = threading.Lock()  # of `_free_bytes` and `drops`
        self._queue: SimpleQueue[Received | None] = SimpleQueue()
        self._untyped: set[str] = set()
        self._thread = threading.Thread(target=self._write_all, name=f"recorder {robot}", daemon=True)
        self._thread.start()
        self._subscription = subscribe_all(session, robot, self._take)

    @property
    def messages(self) -> int:
        """Written so far."""
        return self._writer.messages

    @property
    def recorded_s(self) -> float:
        """How much of the sensors' time is in the recording."""
        return (self._newest_ns - self._oldest_ns) / 1e9

    @property
    def missed(self) -> int:
        """Messages that were sent and never came."""
        return self._subscription.missed

    def close(self) -> None:
        """Write what has come and finish the file."""
        self._subscription.close()
        self._queue.put(None)
        self._thread.join(_CLOSE_S)
        if self.drops or self.missed:
            logger.warning("%s: dropped %s; never came: %d", self.path, dict(self.drops) or "nothing", self.missed)

    def _take(self, message: Received) -> None:
        """On the bus's time: weighs the message and puts it by."""
        name = topic(self._robot, message.key)
        if not message.type:
            if name not in self._untyped:
                self._untyped.add(name)
                logger.info("%s: left out of the recording: it is no ROS message", name)
            return
        with self._lock:
            room = len(message.data) <= self._free_bytes
            if room:
                self._free_bytes -= len(message.data)
            else:
                self.drops[name] += 1
        if room:
            self._queue.put(message)

    def _write_all(self) -> None:
        while (message := self._queue.get()) is not None:
            with self._lock:
                self._free_bytes += len(message.data)
            log_ns = self._clock.log_ns(message.key, message.type, message.data)
            if log_ns is None:
                self._before_clock.append(message)
                if len(self._before_clock) == _WAITING:
                    self._clock.start(message.wall_ns())
                continue
            self._write_waiting(log_ns)
            self._write(message, log_ns)
        if self._before_clock:
            self._write_waiting(self._before_clock[0].wall_ns())
        try:
            self._writer.close()
        except RecordingError as error:
            self._fail(error)

    def _write_waiting(self, log_ns: int) -> None:
        """What came before the first sensor spoke, as if it had come with it."""
        for message in self._before_clock:
            self._write(message, log_ns)
        self._before_clock.clear()

    def _write(self, message: Received, log_ns: int) -> None:
        name = topic(self._robot, message.key)
        if self.error is None:
            try:
                self._writer.write(Message(f"/{self._robot}/{name}", message.type, log_ns, message.data))
                # The oldest first: to whoever asks in between, the newest alone would look like a long drive.
                self._oldest_ns = self._oldest_ns or log_ns
                self._newest_ns = log_ns
                return
            except RecordingError as error:
                self._fail(error)
            except messages.MessageError as error:  # a type without a definition
                if not self.drops[name]:
                    logger.warning("%s: cannot be recorded: %s", name, error)
        with self._lock:
            self.drops[name] += 1

    def _fail(self, error: RecordingError) -> None:
        self.error = error
        logger.error("%s", error)


def _is_sensor(type_name: str) -> bool:
    return type_name == ODOMETRY_TYPE or (
        type_name.startswith("sensor_msgs/") and type_name != "sensor_msgs/msg/PointCloud2"
    )
