"""The stop button's other end: the word goes out at once, and while it holds, with every tick a command to stand still.

Our controllers and robots listen to the word itself (`agents.halt`); the command is for robots that know no word.
"""

import threading

from agents import messages, topics
from agents.agent import Agent
from agents.transport import Frames, State

_STILL = messages.encode(messages.twist(0.0, 0.0))


class StopButton:
    """Says stop, and takes it back.

    Args:
        agent: on whose session it lives.
    """

    def __init__(self, agent: Agent) -> None:
        self._word = State(agent.session, agent.key(topics.STOP), topics.STOP_TYPE)
        self._command = Frames(agent.session, agent.key(topics.COMMAND), topics.COMMAND_TYPE)
        self._turn = threading.Lock()  # a publisher is not for two threads at once
        self._holds = False

    def press(self, stop: bool) -> None:
        """Stop, or go on."""
        with self._turn:
            self._holds = stop
            self._word.put(messages.encode(messages.flag(stop)))
            if stop:
                self._command.put(_STILL)

    def insist(self) -> None:
        """With every tick."""
        with self._turn:
            if self._holds:
                self._command.put(_STILL)
