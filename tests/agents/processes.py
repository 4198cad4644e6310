"""A robot's agents as processes of their own, on an endpoint of their own; what they say, and how they end."""

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Self

import numpy as np

from agents import messages, status, topics
from agents.agent import PARENT
from agents.naming import naming_of
from agents.transport import (
    Received,
    call,
    free_endpoint,
    key,
    open_session,
    present,
    subscribe_state,
    subscribe_stream,
)
from llrp_online.configuration import load
from llrp_online.status import LearnerStatus

ROOT = Path(__file__).parents[2]
WAIT_S = 60.0  # far more than anything takes; only a failing test waits so long
#: Small pictures and short windows, so that labels, steps and versions come within seconds.
QUICK = """
[training]
batch = 8
warmup_frames = 8
[publishing]
every_s = 0.5
trust_after_s = 3600.0
"""


def quick_configuration(folder: Path, **replaced: str) -> Path:
    """The Thymio's TOML, made quick; `replaced` are further texts, with what takes their place."""
    text = (ROOT / "configs" / "thymio.toml").read_text()
    for old, new in {"width = 80": "width = 20", "height = 64": "height = 16", "= 30.0": "= 4.0", **replaced}.items():
        assert old in text
        text = text.replace(old, new)
    path = folder / "quick.toml"
    path.write_text(text + QUICK)
    return path


def until(true: Callable[[], object], what: str, timeout_s: float = WAIT_S) -> None:
    """Wait for what other processes are about to do."""
    end_s = time.monotonic() + timeout_s
    while not true():
        assert time.monotonic() < end_s, f"it never came: {what}"
        time.sleep(0.02)


def patience_s() -> float:
    """Two seconds on a machine that does nothing else; more where others want the cores too."""
    return 2.0 * max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))


class Processes:
    """Processes that meet on one endpoint, on which a session listens; all end with the block."""

    def __init__(self, folder: Path, config: Path, *, hub: bool = True) -> None:
        self.folder, self.config, self.endpoint = folder, config, free_endpoint()
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        configuration = load(config)
        self.robot_name = configuration.robot.name
        self.session = open_session(self.endpoint, hub=hub, name="test", naming=naming_of(configuration))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for process in self.processes.values():
            process.kill()
            process.wait()
        self.session.close()

    def start(self, name: str, *words: str, python: str = sys.executable) -> None:
        """`llrp WORDS` as `name`, whose last process, if any, has ended."""
        assert name not in self.processes or self.processes[name].poll() is not None
        with self.log(name).open("wb") as log:
            self.processes[name] = subprocess.Popen(
                [python, "-m", "agents.cli", *words, "--config", str(self.config), "--endpoint", self.endpoint],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                env={**os.environ, PARENT: str(os.getpid())},
                cwd=ROOT,
            )

    def log(self, name: str) -> Path:
        return self.folder / f"{name}.log"

    def said(self, name: str) -> str:
        return self.log(name).read_text()


class Agents(Processes):
    """Starts agents and listens to them; ends them all with the block."""

    def __init__(self, folder: Path, config: Path, *, hub: bool = True) -> None:
        super().__init__(folder, config, hub=hub)
        self.learner: LearnerStatus | None = None
        self.perceiver: status.PerceiverStatus | None = None
        self.robot: status.RobotStatus | None = None
        self.counts: dict[str, int] = {"odom": 0, "range": 0, "prediction": 0, "labels": 0, "learner/weights": 0}
        self.missed = {name: subscribe_stream(self.session, self.key(name), self._count) for name in self.counts}
        self.commands: list[tuple[float, float]] = []
        for topic, hear in (
            (topics.LEARNER_STATUS, self._hear_learner),
            (topics.PERCEIVER_STATUS, self._hear_perceiver),
            (topics.ROBOT_STATUS, self._hear_robot),
        ):
            subscribe_state(self.session, self.key(topic), hear)
        subscribe_stream(self.session, self.key(topics.COMMAND), self._hear_command)

    def key(self, topic: str) -> str:
        return key(self.robot_name, topic)

    def is_up(self, name: str) -> bool:
        process = self.processes.get(name)
        assert process is None or process.poll() in (None, 0, -signal.SIGKILL), self.said(name)
        return process is not None and process.poll() is None

    def wait_present(self, *names: str) -> None:
        until(
            lambda: (
                all(self.is_up(n) for n in names if n in self.processes)
                and set(names) <= present(self.session, self.robot_name)
            ),
            f"presence of {names}",
        )

    def wait_gone(self, *names: str) -> None:
        until(lambda: not set(names) & present(self.session, self.robot_name), f"absence of {names}")

    def kill(self, name: str) -> None:
        self.processes[name].kill()
        self.processes[name].wait()
        self.wait_gone(name)

    def end(self, name: str, number: signal.Signals = signal.SIGTERM) -> None:
        """Tell it to end, and hold it to its word: soon, with exit code 0, without a traceback."""
        process, began_s = self.processes[name], time.monotonic()
        process.send_signal(number)
        code = process.wait(WAIT_S)
        took_s = time.monotonic() - began_s
        assert code == 0, (name, self.said(name))
        assert took_s < patience_s(), (name, took_s)
        assert "Traceback" not in self.said(name), (name, self.said(name))
        assert "Error" not in self.said(name)

    def start_dashboard(self, port: int = 0, *words: str) -> int:
        """Start one; the port it listens on, which it says a moment after it is present."""
        self.start("dashboard", "dashboard", "--port", str(port), *words)
        until(lambda: "http://" in self.said("dashboard"), "the dashboard's address")
        [said] = re.findall(r"http://127\.0\.0\.1:(\d+)/", self.said("dashboard"))
        return int(said)

    def ask(self, request: bytes, timeout_s: float = WAIT_S) -> bytes:
        return call(self.session, self.key(topics.LEARNER_COMMAND), request, timeout_s)

    def _count(self, message: Received) -> None:
        self.counts[message.key.removeprefix(f"{self.robot_name}/")] += 1

    def _hear_learner(self, message: Received) -> None:
        self.learner = status.decode_learner(message.data)

    def _hear_perceiver(self, message: Received) -> None:
        self.perceiver = status.PerceiverStatus(**status.decode(message.data))

    def _hear_robot(self, message: Received) -> None:
        self.robot = status.RobotStatus(**status.decode(message.data))

    def _hear_command(self, message: Received) -> None:
        self.commands.append(messages.read_twist(messages.decode(message.type, message.data)))

    def is_driving(self) -> bool:
        """Has the robot moved between its last two words, and does somebody command it to?"""
        before = self.robot
        until(lambda: self.robot is not before, "the robot's status")
        return before is not None and self.robot is not None and not np.isclose(self.robot.metres, before.metres)
