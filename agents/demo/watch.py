"""What a watcher of the bus knows: the newest status of each agent, and how old it is."""

import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

from agents import status, topics
from agents.terminal import Glance, Rate
from agents.transport import Received, Session, key, subscribe_state
from llrp_online.status import LearnerStatus


class Watch:
    """Listens to a robot's agents.

    Args:
        session: of Zenoh.
        robot: its name.
    """

    def __init__(self, session: Session, robot: str) -> None:
        self._lock = threading.Lock()
        self._learner: LearnerStatus | None = None
        self._heard_s: float | None = None
        self._perceiver: status.PerceiverStatus | None = None
        self._robot: status.RobotStatus | None = None
        self._rate, self._steps_per_s = Rate(), None
        handlers: dict[str, Callable[[Received], None]] = {
            topics.LEARNER_STATUS: self._hear_learner,
            topics.PERCEIVER_STATUS: self._hear_perceiver,
            topics.ROBOT_STATUS: self._hear_robot,
        }
        self._subscriptions = [subscribe_state(session, key(robot, topic), take) for topic, take in handlers.items()]

    @property
    def learner(self) -> LearnerStatus | None:
        """The learner's newest status."""
        return self._learner

    @property
    def robot(self) -> status.RobotStatus | None:
        """The simulated robot's newest status."""
        return self._robot

    @property
    def perceiver(self) -> status.PerceiverStatus | None:
        """The perceiver's newest status."""
        return self._perceiver

    def glance(self, agents: Mapping[str, bool]) -> Glance:
        """All of it, for the terminal."""
        with self._lock:
            age_s = None if self._heard_s is None else time.monotonic() - self._heard_s
            return Glance(self._learner, age_s, self._steps_per_s, self._perceiver, agents)

    def _hear_learner(self, message: Received) -> None:
        heard, now_s = status.decode_learner(message.data), time.monotonic()
        with self._lock:
            self._learner, self._heard_s = heard, now_s
            self._steps_per_s = self._rate.update(heard.steps, now_s)

    def _hear_perceiver(self, message: Received) -> None:
        values: dict[str, Any] = status.decode(message.data)
        self._perceiver = status.PerceiverStatus(**values)

    def _hear_robot(self, message: Received) -> None:
        self._robot = status.RobotStatus(**status.decode(message.data))
