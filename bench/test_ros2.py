"""What `llrp ros2` adds: a message through rclpy and the node, beside the same straight over Zenoh, in one run.

Both ways, in turn, between the same two processes: a JPEG of the network's size from a robot, a prediction to one.
Wants `make ros-venv`.
"""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from agents import messages, topics
from agents.agent import PARENT
from agents.transport import Frames, Received, free_endpoint, open_session, present, subscribe_latest
from bench.rows import Figure, Row

ROOT = Path(__file__).parents[1]
ROS_PYTHON = os.environ.get("LLRP_ROS_PYTHON") or str(ROOT / ".venv-ros/bin/python")
CONFIG = "configs/thymio.toml"
STRAIGHT = "straight over Zenoh"
#: At most four times as long: a hop of the bus more, a hop of the other middleware, and Python between.
BAR = 1 / 4


@pytest.mark.skipif(not Path(ROS_PYTHON).exists(), reason=f"no {ROS_PYTHON}: `make ros-venv` installs rclpy")
def test_through_rclpy(record, short):
    count, endpoint = 100 if short else 400, free_endpoint()
    heard: dict[str, list[float]] = {"ros": [], "zenoh": []}

    def hear(path: str, message: Received) -> None:
        stamp_ns = messages.stamp_ns(message.type, message.data)
        heard[path].append((time.monotonic_ns() - (stamp_ns or 0)) / 1e6)

    alone = {"ROS_DOMAIN_ID": str(1 + os.getpid() % 100), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    environment = {**os.environ, **alone, PARENT: str(os.getpid()), "PYTHONPATH": str(ROOT)}
    node_words = [ROS_PYTHON, "-m", "agents.cli", "ros2", "--config", CONFIG, "--endpoint", endpoint]
    client_words = [ROS_PYTHON, str(ROOT / "bench/ros2_client.py"), endpoint, str(count)]
    cloud = np.random.default_rng(0).random((31, 5))
    with open_session(endpoint, hub=True, name="bench") as session:
        subscribe_latest(session, "thymio/camera/image/compressed", lambda m: hear("ros", m))
        subscribe_latest(session, "thymio/straight", lambda m: hear("zenoh", m))
        prediction = Frames(session, "thymio/prediction", topics.CLOUD_TYPE)
        with subprocess.Popen(node_words, env=environment, stdout=subprocess.DEVNULL) as node:
            while "ros2" not in present(session, "thymio"):
                assert node.poll() is None
                time.sleep(0.1)
            with subprocess.Popen(client_words, env=environment, stdout=subprocess.PIPE, text=True) as client:
                while client.poll() is None:
                    said = messages.prediction(time.monotonic_ns(), np.zeros((31, 3)), list("abcde"), cloud)
                    prediction.put(messages.encode(said))
                    time.sleep(0.05)
                assert client.stdout is not None
                answered = json.loads(client.stdout.read())
            node.terminate()
    for what, ages in (("picture from a robot", heard), ("prediction to a robot", answered)):
        ros, zenoh = (Figure([ms / 1e3 for ms in ages[path]]) for path in ("ros", "zenoh"))
        assert len(ros.values) > 0.9 * count / 2, sys.version
        added = 1e3 * (ros.median - zenoh.median)
        note = f"adds {added:.2f} ms; p99 {1e3 * np.percentile(ros.values, 99):.1f} ms; {len(ros.values)} messages"
        record(Row(f"{what} through rclpy and `llrp ros2`", ros, {STRAIGHT: zenoh}, {STRAIGHT: BAR}, note=note))
