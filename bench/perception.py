"""Frame to prediction at 20 Hz while the learner trains flat out, beside the same with the learner paused, in one run.

    python bench/perception.py --blocks 6 --seconds 20

Three processes on the bus, as on a robot: this one is the robot's camera and sensors (a simulated drive, made
beforehand), `llrp learn` trains as fast as it can on one thread, `llrp perceive` predicts. Blocks with training
paused and resumed alternate. Times are from the moment a frame is handed to the bus to the moment its prediction is,
on one clock.
"""

import argparse
import json
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack
from itertools import cycle
from pathlib import Path

import numpy as np

from agents import messages, status, topics
from agents.agent import PARENT
from agents.commands import options
from agents.controllers.explore import Explore
from agents.robots.simulated import load_scenario
from agents.robots.wire import ODOMETRY_TYPE, PICTURE_TYPE, RANGE_TYPE, Wire
from agents.rollout import rollout
from agents.simulated_drive import simulated_robot
from agents.transport import (
    Frames,
    Received,
    Stream,
    call,
    key,
    open_session,
    present,
    subscribe_latest,
    subscribe_state,
)
from llrp_online.configuration import RobotConfiguration, load
from replay.recording import Message

RATE_HZ = 20.0
FLAT_OUT = "\n[training]\nsteps_per_second = 100000.0\n"


def drive(configuration: RobotConfiguration, seconds: float) -> list[list[Message]]:
    """The messages of each tick of a simulated drive; a picture with every tick."""
    robot = simulated_robot(configuration, load_scenario(options.scenario_path("tiles")), seed=0)
    wire = Wire(configuration)
    seen = rollout(robot, Explore(configuration.control, 0), configuration, seconds)
    return [list(wire.messages(observation)) for observation in seen]


def restamped(ticks: list[list[Message]], start_ns: int) -> Iterator[tuple[int, list[tuple[str, bytes]]]]:
    """The drive again and again, each time with later stamps: (stamp, [(topic, bytes), ...])."""
    step_ns = round(1e9 / RATE_HZ)
    for index, tick in enumerate(cycle(ticks)):
        t_ns = start_ns + index * step_ns
        out: list[tuple[str, bytes]] = []
        for message in tick:
            decoded = messages.decode(message.type, message.data)
            decoded.header.stamp.sec, decoded.header.stamp.nanosec = divmod(t_ns, 10**9)
            out.append((message.topic, messages.encode(decoded)))
        yield t_ns, out


class Robot:
    """Publishes the drive at 20 Hz and times the predictions that come back."""

    def __init__(
        self, session: object, name: str, ticks: list[list[Message]], configuration: RobotConfiguration
    ) -> None:
        wire = Wire(configuration)
        self._publishers = {
            wire.odometry_topic: Stream(session, key(name, wire.odometry_topic), ODOMETRY_TYPE),
            wire.range_topic: Stream(session, key(name, wire.range_topic), RANGE_TYPE),
            wire.picture_topic: Frames(session, key(name, wire.picture_topic), PICTURE_TYPE),
        }
        self._picture_topic, self._prefix = wire.picture_topic, f"/{name}/"
        self._ticks = restamped(ticks, time.time_ns())
        self._sent_ns: dict[int, int] = {}
        self.latencies_ms: list[float] = []
        self.frames = 0
        self._subscription = subscribe_latest(session, key(name, topics.PREDICTION), self._answer)

    def live(self, seconds: float) -> None:
        """Publish for so long."""
        due = time.monotonic()
        end = due + seconds
        while due < end:
            t_ns, parts = next(self._ticks)
            for topic, data in parts:
                name = topic.removeprefix(self._prefix)
                if name == self._picture_topic:
                    self._sent_ns[t_ns] = time.monotonic_ns()
                    self.frames += 1
                self._publishers[name].put(data)
            due += 1 / RATE_HZ
            time.sleep(max(due - time.monotonic(), 0.0))

    def _answer(self, message: Received) -> None:
        stamp_ns = messages.stamp_ns(message.type, message.data)
        sent_ns = self._sent_ns.pop(stamp_ns, None)
        if sent_ns is not None and message.sent is not None:
            self.latencies_ms.append((message.sent.monotonic_ns - sent_ns) / 1e6)


def start(stack: ExitStack, *words: str) -> subprocess.Popen[bytes]:
    """An agent as a process of its own, ended with the stack."""
    process = subprocess.Popen(
        [sys.executable, "-m", "agents.cli", *words],
        env={**os.environ, PARENT: str(os.getpid())},
        stdout=subprocess.DEVNULL,
    )
    stack.callback(process.wait, 10)
    stack.callback(process.terminate)
    return process


def main() -> None:
    """Print the two distributions and their ratio."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--config", type=Path, default=Path("configs/thymio.toml"))
    parser.add_argument("--blocks", type=int, default=6, help="half of them with training paused")
    parser.add_argument("--seconds", type=float, default=20.0, help="a block")
    parser.add_argument("--realtime", action="store_true", help="ask for real-time priority for the perceiver")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    configuration = load(arguments.config)
    assert configuration.simulation is not None
    every_tick = configuration.simulation.model_copy(update={"camera_divider": 1, "rate_hz": RATE_HZ})
    ticks = drive(configuration.model_copy(update={"simulation": every_tick}), seconds=60.0)
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        busy = folder / "busy.toml"
        busy.write_text(arguments.config.read_text() + FLAT_OUT)
        endpoint = f"tcp/127.0.0.1:{free_port()}"
        session = stack.enter_context(open_session(endpoint, hub=True, name="bench"))
        name = configuration.robot.name
        common = ("--config", str(busy), "--endpoint", endpoint)
        start(stack, "learn", *common, "--output", str(folder / "run"), "--json")
        start(stack, "perceive", *common, *(["--realtime"] if arguments.realtime else []))
        while not {"learner", "perceiver"} <= present(session, name):
            time.sleep(0.2)
        robot = Robot(session, name, ticks, configuration)
        steps: list[int] = []
        subscribe_state(
            session, key(name, topics.LEARNER_STATUS), lambda m: steps.append(status.decode_learner(m.data).steps)
        )
        robot.live(20.0)  # until there is something to learn from, and weights to predict with
        results: dict[str, list[float]] = {"paused": [], "training": []}
        trained = [0, 0.0]
        for block in range(arguments.blocks):
            kind = "paused" if block % 2 == 0 else "training"
            request = {"command": "pause" if kind == "paused" else "resume"}
            call(session, key(name, topics.LEARNER_COMMAND), json.dumps(request).encode())
            robot.live(1.0)
            robot.latencies_ms.clear()
            robot.frames, before = 0, steps[-1]
            robot.live(arguments.seconds)
            robot.live(1.0) if kind == "training" else None
            results[kind] += robot.latencies_ms
            if kind == "training":
                trained = [trained[0] + steps[-1] - before, trained[1] + arguments.seconds]
    report(results, trained[0] / max(trained[1], 1e-9), arguments)


def free_port() -> int:
    """A port nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def report(results: dict[str, list[float]], steps_per_s: float, arguments: argparse.Namespace) -> None:
    """Print it."""
    table = {
        kind: {f"p{q:g}_ms": round(float(np.percentile(values, q)), 2) for q in (50, 99, 99.9)} | {"n": len(values)}
        for kind, values in results.items()
    }
    ratio = table["training"]["p99_ms"] / table["paused"]["p99_ms"]
    if arguments.json:
        print(json.dumps({**table, "p99_ratio": ratio, "steps_per_s": steps_per_s}))
        return
    for kind, row in table.items():
        print(f"{kind:8s} " + ", ".join(f"{name} {value}" for name, value in row.items()))
    print(f"p99 ratio {ratio:.2f}; {steps_per_s:.1f} training steps a second")


if __name__ == "__main__":
    main()
