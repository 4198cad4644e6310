"""ROS 2 clients that others wrote, with a robot's drive in their hands: rclpy, PyZeROS, zenoh-ros2-sdk.

They live in an environment of their own: `make ros-venv`, or LLRP_ROS_PYTHON names its Python. The drives want a
machine that is not starved: pictures that waited longer than `transport.stale_s` are skipped, as they should be.
"""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
import zenoh

from agents import messages, status, topics
from agents.transport import Frames, Received, State, free_endpoint, subscribe_stream
from replay.recording import read
from tests.agents.processes import ROOT, Agents, until

pytestmark = pytest.mark.live

ROS_PYTHON = os.environ.get("LLRP_ROS_PYTHON") or str(ROOT / ".venv-ros/bin/python")
needs_ros = pytest.mark.skipif(
    not Path(ROS_PYTHON).exists(), reason=f"no {ROS_PYTHON}: `make ros-venv` installs rclpy, PyZeROS, zenoh-ros2-sdk"
)
ODOMETRY, SCAN, PICTURE = "nav_msgs/msg/Odometry", "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/CompressedImage"
FRAME_NS = 50_000_000
FIRST_S = 5.0  # the bar
#: A minute after the first prediction; CI, where every minute of the suite counts, does with less.
DRIVE_S = 20.0 if os.environ.get("CI") else 66.0


@pytest.fixture(autouse=True)
def _apart(monkeypatch):
    """Nobody else's nodes are met, and what PyZeROS compiles is kept."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(1 + os.getpid() % 100))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv("CYDR_CACHE_DIR", str(Path(ROS_PYTHON).parents[1] / "cydr"))
    monkeypatch.setenv("PYTHONPATH", str(ROOT))


def configuration(folder: Path, keys: str = "") -> Path:
    """The Thymio with a picture at every tick: 20 a second."""
    text = (ROOT / "configs/thymio.toml").read_text()
    path = folder / "robot.toml"
    path.write_text(text.replace('kind = "thymio"', 'kind = "thymio"\ncamera_divider = 1') + keys)
    return path


@contextmanager
def router(endpoint: str) -> Iterator[None]:
    """As rmw_zenohd: what nodes of rmw_zenoh find each other by."""
    told = zenoh.Config()
    for path, value in {
        "mode": "router",
        "listen/endpoints": [endpoint],
        "scouting/multicast/enabled": False,
    }.items():
        told.insert_json5(path, json.dumps(value))
    with zenoh.open(told):
        yield


CLIENT = """
import sys
import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.qos import qos_profile_sensor_data
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import CompressedImage, LaserScan, PointCloud2
from std_msgs.msg import Bool

rclpy.init()
node = rclpy.create_node("client")
pictures = node.create_publisher(CompressedImage, "/camera/image/compressed", qos_profile_sensor_data)
odometry = node.create_publisher(Odometry, "/odom", 10)
scans = node.create_publisher(LaserScan, "/range", qos_profile_sensor_data)
sent = {pictures: CompressedImage(format="jpeg", data=list(range(200))), odometry: Odometry(), scans: LaserScan()}
sent[odometry].pose.pose.position.x = 1.5
sent[scans].ranges = [0.5, 2.5]
held = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
heard = {"status": 0, "stop": 0, "command": 0, "prediction": 0}
def hear(name, text):
    def take(message):
        if not heard[name]:
            print(name, text(message), flush=True)
        heard[name] = 1
    return take
node.create_subscription(Twist, "/cmd_vel", hear("command", lambda m: (m.linear.x, m.angular.z)), 10)
node.create_subscription(PointCloud2, "/prediction", hear("prediction", lambda m: m.fields[4].name), 10)
node.create_subscription(DiagnosticArray, "/robot/status", hear("status", lambda m: m.status[0].name), held)
node.create_subscription(Bool, "/stop", hear("stop", lambda m: m.data), held)
left = dict.fromkeys(sent, 20)
while not all(heard.values()) or any(left.values()):
    for publisher, message in sent.items():
        if publisher.get_subscription_count():
            publisher.publish(message)
            left[publisher] = max(0, left[publisher] - 1)
    rclpy.spin_once(node, timeout_sec=0.05)
rclpy.shutdown()
"""


@needs_ros
def test_a_node_of_any_middleware_is_handed_everything_and_hands_everything_over(tmp_path):
    cloud = messages.prediction(5, np.zeros((1, 3)), ["left"], [[0.5]])
    with Agents(tmp_path, configuration(tmp_path)) as agents:
        found: dict[str, list[Received]] = {"odom": [], "range": [], "camera/image/compressed": []}
        for name, heard in found.items():
            subscribe_stream(agents.session, agents.key(name), heard.append)
        held = State(agents.session, agents.key(topics.ROBOT_STATUS), topics.STATUS_TYPE)
        held.put(status.encode("robot", 0, asdict(status.RobotStatus(1.0, 0, 2.0))))
        stop = State(agents.session, agents.key(topics.STOP), topics.STOP_TYPE)
        stop.put(messages.encode(messages.flag(True)))
        command = Frames(agents.session, agents.key(topics.COMMAND), topics.COMMAND_TYPE)
        prediction = Frames(agents.session, agents.key(topics.PREDICTION), topics.CLOUD_TYPE)
        agents.start("ros2", "ros2", python=ROS_PYTHON)
        agents.wait_present("ros2")
        with subprocess.Popen([ROS_PYTHON, "-c", CLIENT], stdout=subprocess.PIPE, text=True) as client:

            def said() -> bool:
                command.put(messages.encode(messages.twist(0.1, -0.5)))
                prediction.put(messages.encode(cloud))
                assert agents.is_up("ros2")
                return client.poll() is not None

            until(said, "the client has heard all")
            assert client.stdout is not None
            lines = set(client.stdout.read().splitlines())
        assert client.returncode == 0
        assert lines == {"command (0.1, -0.5)", "prediction left", "status robot", "stop True"}
        until(lambda: all(found.values()), "pictures, odometry and ranges")
        agents.end("ros2")
        assert "odom: " in agents.said("ros2")
    first = {name: heard[0] for name, heard in found.items()}
    assert [message.type for message in first.values()] == [ODOMETRY, SCAN, PICTURE]
    decoded = [messages.decode(message.type, message.data) for message in first.values()]
    assert decoded[0].pose.pose.position.x == 1.5
    assert decoded[1].ranges.tolist() == [0.5, 2.5]
    assert decoded[2].data.tolist() == list(range(200))


def test_llrp_ros2_says_what_is_not_there(tmp_path):
    refused = configuration(tmp_path, '\n[keys]\nmapping = "ros2-zenoh"\n')
    words = [sys.executable, "-m", "agents.cli", "ros2", "--endpoint", free_endpoint(), "--config"]
    for config, said in (
        (refused, "keys.mapping = 'ros2-zenoh': agents speak to ROS 2 themselves then"),
        (ROOT / "configs/thymio.toml", "rclpy is not installed here"),
    ):
        run = subprocess.run([*words, str(config)], capture_output=True, text=True, check=False, cwd=ROOT)
        assert run.returncode == 1
        assert said in run.stderr
        assert "Traceback" not in run.stderr


@pytest.fixture(scope="module")
def drive(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("drive")
    words = ["record", "--simulate", "--minutes", f"{DRIVE_S / 60}", "--config", str(configuration(folder))]
    path = folder / "drive.mcap"
    subprocess.run([sys.executable, "-m", "agents.cli", *words, "--output", str(path)], check=True, cwd=ROOT)
    return path


@needs_ros
@pytest.mark.slow
@pytest.mark.parametrize("name", ["rclpy", "pyzeros", "zenoh_sdk"])
def test_a_drive_at_20_pictures_a_second_has_every_prediction_from_the_first_seconds_on(tmp_path, drive, name):
    if name == "pyzeros" and not shutil.which("cc"):
        pytest.skip("no C compiler, which PyZeROS wants when it is first used: apt-get install gcc")
    keys = "" if name == "rclpy" else '\n[keys]\nmapping = "ros2-zenoh"\n'
    with Agents(tmp_path, configuration(tmp_path, keys), hub=name == "rclpy") as agents:
        host, port = agents.endpoint.removeprefix("tcp/").split(":")
        where = {"rclpy": [], "pyzeros": [agents.endpoint], "zenoh_sdk": [host, port]}[name]
        with router(agents.endpoint) if name != "rclpy" else nullcontext():
            agents.start("learner", "learn", "--output", str(tmp_path / "run"))
            agents.start("perceiver", "perceive")
            agents.start("controller", "control")
            if name == "rclpy":
                agents.start("ros2", "ros2", python=ROS_PYTHON)
            agents.wait_present("learner", "perceiver", "controller", *(["ros2"] if name == "rclpy" else []))
            words = [ROS_PYTHON, str(ROOT / f"examples/ros2_{name}.py"), str(drive), *where]
            run = subprocess.run(words, capture_output=True, text=True, timeout=200, check=False, cwd=tmp_path)
        agents.end("perceiver")
        assert run.returncode == 0, run.stderr
    lines = [line.split() for line in run.stdout.splitlines()]
    stamps = [int(line[1]) for line in lines if line[0] == "prediction"]
    pictures = [messages.stamp_ns(m.type, m.data) for m in read(drive) if m.type == PICTURE]
    assert pictures[1] - pictures[0] == FRAME_NS
    assert stamps == [t_ns for t_ns in pictures if t_ns >= stamps[0]]
    assert stamps[0] - pictures[0] <= FIRST_S * 1e9
    assert len(stamps) >= 20 * (DRIVE_S - FIRST_S) - 1
    assert sum(line[0] == "command" for line in lines) > 15 * (DRIVE_S - FIRST_S)
