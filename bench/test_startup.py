"""The start of every command, to its first useful output, beside importing PyTorch; and `llrp --help`.

Useful is the first line of what was asked for, on either output. An agent has no such line: its first message is, or,
of those who speak only when spoken to, its name on the bus.
"""

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from agents.agent import PARENT
from agents.cli import COMMANDS
from agents.transport import free_endpoint, open_session, subscribe_all, watch
from bench.rows import Figure, Row

CONFIG = "configs/thymio.toml"
ROBOT = "thymio"
LLRP = (sys.executable, "-m", "agents.cli")
ROS_PYTHON = os.environ.get("LLRP_ROS_PYTHON") or ".venv-ros/bin/python"
TORCH = "python -c 'import torch'"
NOTHING = "python -c pass"
WAIT_S = 60.0

#: Command -> why it says nothing sooner.
PRINTING_LATE = {
    "train": "it has labelled half a minute of driving, loaded the kernels and taken a step before it says something",
    "learn": "its one line is the outcome: it has lived through half a minute of driving, with 150 steps of training",
    "export": "it loads PyTorch, whose network it holds the file against on all remembered frames before it says so",
    "completion": "it loads every command's words, and with them PyTorch",
    "experiment": "it loads PyTorch, which its trials need, and draws all figures anew before it prints a claim",
}
AGENTS_LATE = {"learn": "PyTorch, then ONNX Runtime, the bus, and its first status once the first second is over"}

Start = Callable[[], float]


@dataclass(frozen=True)
class Inputs:
    """What commands work on: a short drive, and what was learned from it."""

    folder: Path
    recording: Path
    checkpoint: Path

    def studied(self) -> Path:
        """The folder of a study whose trials are all kept: run now, if it has not been."""
        study = self.folder / "study"
        if not study.exists():
            words = (*LLRP, "experiment", "scratch", "--quick", "--output", str(study))
            subprocess.run(words, check=True, capture_output=True)
        return study

    def fresh(self) -> Path:
        """A name that nobody has used."""
        return self.folder / f"output-{time.monotonic_ns()}"


#: Command -> its words, for those that print.
PRINTING: dict[str, Callable[[Inputs], Sequence[object]]] = {
    "record": lambda i: ("--simulate", "--minutes", 0.01, "--output", i.fresh()),
    "check": lambda i: (i.recording,),
    "label": lambda i: (i.recording, "--output", i.fresh()),
    "train": lambda i: (i.recording, "--steps", 1, "--output", i.fresh()),
    "evaluate": lambda i: (i.checkpoint, i.recording),
    "learn": lambda i: ("--recordings", i.recording, "--output", i.fresh()),
    "explain": lambda i: (i.recording, "--at", 5),
    "demo": lambda i: ("--minutes", 1, "--output", i.fresh()),
    "window": lambda i: (i.recording, "--output", i.fresh()),
    "export": lambda i: (i.checkpoint, "--onnx", i.fresh()),
    "completion": lambda _: ("bash",),
    "calibrate": lambda _: (),
    "experiment": lambda i: ("scratch", "--quick", "--output", i.studied()),
}
#: Commands that take their robots from `configs/` or from a checkpoint, or need none.
UNCONFIGURED = ("experiment", "export", "completion")
#: Command -> its words, and the topic of the message that is waited for; "": any; None: its name on the bus.
AGENTS: dict[str, tuple[Callable[[Inputs], Sequence[object]], str | None]] = {
    "robot": (lambda _: (), ""),
    "play": (lambda i: (i.recording,), ""),
    "control": (lambda _: (), None),
    "perceive": (lambda _: (), "perceiver/status"),
    "learn": (lambda i: ("--output", i.fresh()), "learner/status"),
    "record": (lambda i: ("--output", i.fresh()), None),
    "foxglove": (lambda _: ("--port", "0"), None),
    "ros2": (lambda _: (), None),
    "dashboard": (lambda _: ("--port", "0"), None),
}


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Inputs:
    folder = tmp_path_factory.mktemp("startup")
    found = Inputs(folder, folder / "drive.mcap", folder / "checkpoint")
    drive = ("record", "--simulate", "--minutes", "0.5", "--output", found.recording)
    train = ("train", found.recording, "--steps", "1", "--output", found.checkpoint)
    for words in (drive, train):
        subprocess.run([*LLRP, *map(str, words), "--config", CONFIG], check=True, capture_output=True)
    return found


@contextmanager
def process(words: Sequence[object], output: int) -> Iterator[subprocess.Popen[bytes]]:
    """Both outputs go to `output`."""
    started = subprocess.Popen(
        [str(word) for word in words],
        stdin=subprocess.DEVNULL,
        stdout=output,
        stderr=subprocess.STDOUT,
        env={**os.environ, PARENT: str(os.getpid())},
    )
    try:
        yield started
    finally:
        started.terminate()
        started.communicate()


def until_line(words: Sequence[object]) -> float:
    """Seconds until it prints, or, of one that prints nothing, ends."""
    start = time.perf_counter()
    with process(words, subprocess.PIPE) as started:
        assert started.stdout is not None
        line = started.stdout.readline()
        took = time.perf_counter() - start
        assert b"Error" not in line
        assert not line.startswith(b"llrp"), line
    return took


def until_heard(words: Sequence[object], topic: str | None) -> float:
    """Seconds until an agent's first message on a topic, or its name, is on the bus."""
    heard, endpoint = threading.Event(), free_endpoint()
    with open_session(endpoint, hub=True, name="bench") as session:
        listening = (
            watch(session, ROBOT, lambda _agent, there: heard.set() if there else None)
            if topic is None
            else subscribe_all(session, ROBOT, lambda m: heard.set() if m.key.endswith(topic) else None)
        )
        start = time.perf_counter()
        with process([*words, "--endpoint", endpoint], subprocess.DEVNULL):
            assert heard.wait(WAIT_S)
            took = time.perf_counter() - start
        listening.close()
    return took


def in_turn(starts: dict[str, Start], runs: int) -> dict[str, Figure]:
    """Each once for the caches, then each in every turn."""
    for start in starts.values():
        start()
    seconds: dict[str, list[float]] = {name: [] for name in starts}
    for _ in range(runs):
        for name, start in starts.items():
            seconds[name].append(start())
    return {name: Figure(values) for name, values in seconds.items()}


def torch() -> float:
    return until_line([sys.executable, "-c", "import torch"])


def nothing() -> float:
    return until_line([sys.executable, "-c", "pass"])


@pytest.mark.parametrize("command", PRINTING)
def test_command(command, inputs, record, short):
    words = PRINTING[command]
    configured = () if command in UNCONFIGURED else ("--config", CONFIG)

    def ours() -> float:
        return until_line([*LLRP, command, *words(inputs), *configured])

    found = in_turn({"ours": ours, TORCH: torch}, 2 if short else 5)
    gaps = {TORCH: PRINTING_LATE[command]} if command in PRINTING_LATE else {}
    record(Row(f"llrp {command}, to its first line", found["ours"], {TORCH: found[TORCH]}, {TORCH: 1 / 1.3}, gaps=gaps))


@pytest.mark.parametrize("command", AGENTS)
def test_agent(command, inputs, record, short):
    words, topic = AGENTS[command]
    if command == "ros2" and not Path(ROS_PYTHON).exists():
        pytest.skip(f"no {ROS_PYTHON}: `make ros-venv` installs rclpy")
    llrp = (ROS_PYTHON, *LLRP[1:]) if command == "ros2" else LLRP

    def ours() -> float:
        return until_heard([*llrp, command, *words(inputs), "--config", CONFIG], topic)

    found = in_turn({"ours": ours, TORCH: torch}, 2 if short else 5)
    gaps = {TORCH: AGENTS_LATE[command]} if command in AGENTS_LATE else {}
    record(Row(f"llrp {command}, live", found["ours"], {TORCH: found[TORCH]}, {TORCH: 1 / 1.3}, gaps=gaps))


def test_help(record, short):
    found = in_turn({"ours": lambda: until_line([*LLRP, "--help"]), TORCH: torch, NOTHING: nothing}, 2 if short else 5)
    record(Row("llrp --help", found["ours"], {TORCH: found[TORCH], NOTHING: found[NOTHING]}, {TORCH: 4}))


def test_every_command_is_measured():
    assert {*PRINTING, *AGENTS} == set(COMMANDS)
