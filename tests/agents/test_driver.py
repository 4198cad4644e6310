"""What a driver does when it is told to stop before it has begun."""

import threading

import pytest

from agents import driver, messages, topics
from agents.agent import Agent
from agents.controllers.reflex import Reflex
from agents.driver import Driver
from agents.halt import Halt
from agents.transport import State, free_endpoint, open_session, subscribe_stream
from llrp_online.configuration import load
from tests.agents.processes import until

pytestmark = pytest.mark.live


def test_a_stop_said_before_it_was_there_is_obeyed_while_it_is_built(monkeypatch: pytest.MonkeyPatch) -> None:
    class Hasty(Halt):
        """Hears the word before anybody has it in hand, as a busy machine may have it."""

        def __init__(self, *words: object) -> None:
            super().__init__(*words)  # pyright: ignore[reportArgumentType]
            until(lambda: self.holds, "the stop")

    monkeypatch.setattr(driver, "Halt", Hasty)
    configuration, commands = load("configs/thymio.toml"), list[tuple[float, float]]()
    with open_session(free_endpoint(), name="robot") as session:
        agent = Agent(session, "thymio", threading.Event())
        button = State(session, agent.key(topics.STOP), topics.STOP_TYPE)
        button.put(messages.encode(messages.flag(True)))
        command = agent.key(topics.COMMAND)
        subscribe_stream(
            session, command, lambda m: commands.append(messages.read_twist(messages.decode(m.type, m.data)))
        )
        drives = Driver(agent, configuration, Reflex(configuration.control))
        until(lambda: commands, "a command")
        drives.close()
    assert set(commands) == {(0.0, 0.0)}
