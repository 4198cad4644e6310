"""Agents as processes: started, watched, and all ended, whatever happens."""

import os
import subprocess
import sys
import time
from pathlib import Path
from types import TracebackType
from typing import Self

from agents.agent import PARENT

#: Who has not ended so long after SIGTERM is killed. Two seconds do, but a learner on a slow disk is not to be cut off.
_GRACE_S = 15.0


class AgentDied(RuntimeError):  # noqa: N818 - says what happened
    """An agent ended that should not have; the message ends with what it said last."""


class Fleet:
    """Starts agents of one configuration on one endpoint; a context manager that ends them all.

    Args:
        config: the robot's TOML.
        endpoint: where they meet.
        logs: folder; each agent writes NAME.log.
    """

    def __init__(self, config: Path, endpoint: str, logs: Path) -> None:
        self._common = ["--config", str(config), "--endpoint", endpoint]
        self._logs = logs
        self._processes: dict[str, subprocess.Popen[bytes]] = {}
        self._spare: set[str] = set()
        logs.mkdir(parents=True, exist_ok=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def start(self, name: str, *words: str, spare: bool = False) -> None:
        """Start `llrp WORDS...` as the agent `name`; a `spare` one may end, and nobody minds."""
        if spare:
            self._spare.add(name)
        with (self._logs / f"{name}.log").open("ab") as log:
            self._processes[name] = subprocess.Popen(
                [sys.executable, "-m", "agents.cli", *words, *self._common],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                env={**os.environ, PARENT: str(os.getpid())},
                start_new_session=True,  # Ctrl-C comes to the demo alone, which ends them in order
            )

    def alive(self) -> dict[str, bool]:
        """Name -> is its process running."""
        return {name: process.poll() is None for name, process in self._processes.items()}

    def pids(self) -> dict[str, int]:
        """Name -> its process id."""
        return {name: process.pid for name, process in self._processes.items()}

    def ended_well(self, name: str) -> bool:
        """Has the agent ended with exit code 0?"""
        return self._processes[name].poll() == 0

    def check(self, may_end: str = "") -> None:
        """AgentDied if an agent has ended: in error, or at all if it is not the one that `may_end`."""
        for name, process in self._processes.items():
            if name not in self._spare and process.poll() not in ((None, 0) if name == may_end else (None,)):
                log = self._logs / f"{name}.log"
                last = "\n".join(log.read_text(errors="replace").splitlines()[-5:])
                raise AgentDied(f"{name} ended with exit code {process.returncode}; {log} ends with:\n{last}")

    def stop(self, *names: str) -> None:
        """End these agents, or all; returns when they have ended."""
        ending = [self._processes.pop(name) for name in (names or tuple(self._processes))]
        for process in ending:
            process.terminate()
        deadline = time.monotonic() + _GRACE_S
        for process in ending:
            try:
                process.wait(max(deadline - time.monotonic(), 0.0))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
