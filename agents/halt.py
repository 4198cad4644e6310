"""The stop: a person's word that the robot is to stand still, which holds until a person takes it back.

It is a topic of its own and no command among others: whoever drives goes on talking, and the newest command wins. So
those who drive and those who are driven listen to it themselves, and while it holds command, or obey, nothing else.
"""

import threading
from collections.abc import Callable

from agents import messages, topics
from agents.messages import MessageError
from agents.transport import Received, Session, key, subscribe_state


class Halt:
    """Is the robot to stand still? False until somebody says so.

    Args:
        session: of Zenoh.
        robot: its name.
        on_change: called, in a thread of its own, whenever it changes.

    >>> from agents.transport import State, free_endpoint, open_session
    >>> with open_session(free_endpoint(), name="robot") as session:
    ...     changed = threading.Event()
    ...     halt = Halt(session, "thymio", changed.set)
    ...     button = State(session, "thymio/stop", topics.STOP_TYPE)
    ...     button.put(messages.encode(messages.flag(True)))
    ...     changed.wait(5.0), halt.holds
    (True, True)
    """

    def __init__(self, session: Session, robot: str, on_change: Callable[[], None] = lambda: None) -> None:
        self._holds = threading.Event()
        self._on_change = on_change
        self._subscription = subscribe_state(session, key(robot, topics.STOP), self._hear)

    @property
    def holds(self) -> bool:
        """Is it to stand still?"""
        return self._holds.is_set()

    def close(self) -> None:
        """Listen no more."""
        self._subscription.close()

    def _hear(self, message: Received) -> None:
        try:
            wanted = messages.read_flag(messages.decode(message.type or topics.STOP_TYPE, message.data))
        except MessageError:
            return  # what is no word of a person changes nothing
        if wanted != self.holds:
            (self._holds.set if wanted else self._holds.clear)()
            self._on_change()
