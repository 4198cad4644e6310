"""A robot on the bus for benchmarks: it sends a drive, and times the predictions that come back.

A time is from the moment a frame is handed to the bus to the moment its prediction is, on the machine's one clock.
"""

import time
from collections.abc import Generator
from contextlib import contextmanager
from itertools import groupby
from pathlib import Path

from agents import messages, topics
from agents.demo.fleet import Fleet
from agents.intake import Intake
from agents.robots.wire import ODOMETRY_TYPE, PICTURE_TYPE, RANGE_TYPE
from agents.transport import Frames, Received, Session, Stream, key, open_session, present, subscribe_latest
from bench.synthetic import PICTURE_TOPIC, RATE_HZ, drive
from llrp_online.configuration import RobotConfiguration
from llrp_online.learner import Learner
from replay.recording import Message

_LONGEST_S = 3600.0
#: The last answers come within this.
_ANSWER_S = 0.5


class Robot:
    """Publishes odometry, ranges and a picture at each tick.

    Attributes:
        latencies_s: stamp of a frame [ns] to the seconds until its prediction was sent.
    """

    def __init__(self, session: Session, name: str) -> None:
        ticks = drive(_LONGEST_S, start_ns=time.time_ns())
        self._ticks = (list(tick) for _, tick in groupby(ticks, key=lambda message: message.log_ns))
        first = next(self._ticks)
        kinds = {ODOMETRY_TYPE: Stream, RANGE_TYPE: Stream, PICTURE_TYPE: Frames}
        self._publishers = {m.topic: kinds[m.type](session, key(name, _relative(m, name)), m.type) for m in first}
        self._sent_ns: dict[int, int] = {}
        self.latencies_s: dict[int, float] = {}
        self._subscription = subscribe_latest(session, key(name, topics.PREDICTION), self._answer)

    def tick(self) -> int:
        """Publish the next messages; the stamp of their frame [ns]."""
        tick = next(self._ticks)
        for message in tick:
            if message.topic == PICTURE_TOPIC:
                self._sent_ns[message.log_ns] = time.monotonic_ns()
            self._publishers[message.topic].put(message.data)
        return tick[-1].log_ns

    def live(self, seconds: float) -> list[float]:
        """Publish at the drive's rate for so long; how long each prediction took [s]."""
        stamps: list[int] = []
        due_s = time.monotonic()
        for _ in range(round(seconds * RATE_HZ)):
            stamps.append(self.tick())
            due_s += 1 / RATE_HZ
            time.sleep(max(due_s - time.monotonic(), 0.0))
        return self.answers(stamps)

    def answers(self, stamps: list[int]) -> list[float]:
        """How long the predictions of these frames took [s]; one that was skipped for a newer frame is left out."""
        time.sleep(_ANSWER_S)
        return [self.latencies_s[stamp] for stamp in stamps if stamp in self.latencies_s]

    def _answer(self, message: Received) -> None:
        stamp_ns = messages.stamp_ns(message.type, message.data)
        if message.sent is not None and stamp_ns in self._sent_ns:
            self.latencies_s[stamp_ns] = (message.sent.monotonic_ns - self._sent_ns.pop(stamp_ns)) / 1e9


@contextmanager
def together(config: Path, folder: Path, endpoint: str, name: str, **agents: tuple[str, ...]) -> Generator[Session]:
    """A session beside these agents of the robot `name`, each by the words of its command, once all are there."""
    with open_session(endpoint, hub=True, name="bench") as session, Fleet(config, endpoint, folder) as fleet:
        for agent, words in agents.items():
            fleet.start(agent, *words)
        while not set(agents) <= present(session, name):
            fleet.check()
            time.sleep(0.1)
        yield session


def learned(configuration: RobotConfiguration, seconds: float) -> Learner:
    """A learner that has lived through so much of the drive, its kernels compiled and in the cache."""
    learner, intake = Learner(configuration), Intake(configuration)
    for message in drive(seconds):
        for event in intake.events(message.topic, message.type, message.data, message.log_ns):
            learner.take(event)
        while learner.due():
            learner.step()
    learner.publish_now()
    learner.status()
    return learner


def _relative(message: Message, name: str) -> str:
    return message.topic.removeprefix(f"/{name}/")
