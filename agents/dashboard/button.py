"""The stop button's other end: the word goes out at once, and while it holds, with every tick a command to stand still.

Our controllers and robots listen to the word itself (`agents.halt`); the command is for robots that know no word.
"""

import threading
import time
from collections.abc import Callable

from agents import messages, topics
from agents.agent import Agent
from agents.command import Commands
from agents.transport import State
from llrp_online.configuration import RobotConfiguration


class StopButton:
    """Says stop, and takes it back.

    Args:
        agent: on whose session it lives.
        configuration: the robot's.
        clock: the sensors' time [ns], which stamps the command where its type has one; None: not known, the wall's.
    """

    def __init__(self, agent: Agent, configuration: RobotConfiguration, clock: Callable[[], int | None]) -> None:
        self._word = State(agent.session, agent.key(topics.STOP), topics.STOP_TYPE)
        self._commands, self._clock = Commands(agent, configuration), clock
        self._turn = threading.Lock()  # a publisher is not for two threads at once
        self._holds = False

    def press(self, stop: bool) -> None:
        """Stop, or go on."""
        with self._turn:
            self._holds = stop
            self._word.put(messages.encode(messages.flag(stop)))
            if stop:
                self._stand()

    def insist(self) -> None:
        """With every tick."""
        with self._turn:
            if self._holds:
                self._stand()

    def _stand(self) -> None:
        now_ns = self._clock()
        self._commands.send(time.time_ns() if now_ns is None else now_ns, 0.0, 0.0)
