"""What every agent is: one process, one session, one name on the bus; Ctrl-C, SIGTERM or its parent's death end it."""

import os
import threading
import time
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass

from agents.ending import ended_by_signals
from agents.naming import naming_of
from agents.transport import Session, announce, key, open_session, watch_elder
from llrp_online.configuration import RobotConfiguration
from replay import compiling

#: Set by a program that starts agents: its process id. When it dies, however suddenly, they end too.
PARENT = "LLRP_PARENT"
_LOOK_EVERY_S = 0.5
#: Links to the agents that are there come within this, mostly; one that is met later is given way to then.
_MEET_S = 0.5


class AgentError(RuntimeError):
    """An agent that cannot be; the message says why, and what to do."""


@dataclass(frozen=True)
class Agent:
    """An agent on the bus.

    Attributes:
        session: of Zenoh.
        robot: whose agent it is.
        stop: set when it is to end.
    """

    session: Session
    robot: str
    stop: threading.Event

    def key(self, topic: str) -> str:
        """The robot's key of a topic."""
        return key(self.robot, topic)


@contextmanager
def joined(configuration: RobotConfiguration, name: str, *, alone: bool = True) -> Generator[Agent]:
    """Be the agent `name` of a robot until the block ends; Ctrl-C and SIGTERM set `stop`.

    Args:
        configuration: the robot's.
        name: says what it is; a robot has one learner, one controller, and so on.
        alone: AgentError if the robot has one of this name already. Those who only listen may be many.
    """
    compiling.never_wait()
    with ended_by_signals() as stop:
        yield from _joined(configuration, name, stop, alone=alone)


def _joined(configuration: RobotConfiguration, name: str, stop: threading.Event, *, alone: bool) -> Generator[Agent]:
    if parent := os.environ.get(PARENT):
        threading.Thread(target=_follow, args=(int(parent), stop), name="parent", daemon=True).start()
    robot = configuration.robot.name
    since_ns, elder = time.time_ns(), threading.Event()

    def give_way() -> None:
        elder.set()
        stop.set()

    with open_session(configuration.transport.endpoint, name=name, naming=naming_of(configuration)) as session:
        presence = announce(session, robot, name, since_ns)
        if alone:
            watch_elder(session, robot, name, since_ns, give_way)
            elder.wait(_MEET_S)
        if not elder.is_set():
            yield Agent(session, robot, stop)
        presence.undeclare()
    if elder.is_set():
        raise AgentError(
            f"{robot} has a {name} already at {configuration.transport.endpoint}, and two would contradict each other: "
            "end that one first, or give this one another --endpoint"
        )


def _follow(parent: int, stop: threading.Event) -> None:
    while not stop.wait(_LOOK_EVERY_S):
        if os.getppid() != parent:
            stop.set()
