"""The ready configurations, each on messages of its robot's real types: a drive up to a wall, back, and up again."""

import math
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from agents import messages
from agents.checks import check
from agents.commands.label import as_arrays
from agents.naming import ros_names, types_of
from agents.offline import labels_of
from llrp_online.configuration import RobotConfiguration, load
from llrp_online.events import OdometrySample
from replay.recording import Message, Writer, read
from tests.agents.processes import ROOT
from tests.agents.robots import bumper_event, hazards, intensities, scan, sonar
from tests.replay.bags import write_ros1, write_ros2

WALL_M, STEP_M, STEP_NS = 3.0, 0.01, 50_000_000
TOUCHING_M = 0.015
Sense = Callable[[int, float, bool], Iterator[tuple[str, object]]]


def path_m() -> list[float]:
    """Up to the wall, back a metre and a half, up to it again."""
    there = [round(i * STEP_M, 3) for i in range(round(WALL_M / STEP_M))]
    return there + there[::-1][:150] + there[-150:]


def turtlebot4(t_ns: int, wall_m: float, _first: bool) -> Iterator[tuple[str, object]]:
    names = ("side_left", "left", "front_left", "front_center_left", "front_center_right", "front_right", "right")
    ahead = 400 if wall_m < 0.1 else 15
    values = {f"ir_intensity_{name}": ahead if "front" in name else 12 for name in names}
    yield "/ir_intensity", intensities(t_ns, values)
    found = [(0, "base_link")] + [(1, "bump_front_center")] * (wall_m < TOUCHING_M)
    yield "/hazard_detection", hazards(t_ns, found)


def turtlebot3(t_ns: int, wall_m: float, _first: bool) -> Iterator[tuple[str, object]]:
    angles = np.radians(np.arange(360))
    with np.errstate(divide="ignore"):
        ranges = np.where(np.cos(angles) > 0.1, wall_m / np.cos(angles), math.inf)
    ranges[(ranges < 0.12) | (ranges > 3.5)] = 0.0  # as its driver does
    yield "/scan", scan(ranges, 0.0, math.radians(1), (0.12, 3.5), t_ns)


class Kobuki:
    def __init__(self) -> None:
        self.pressed = False

    def __call__(self, _t_ns: int, wall_m: float, first: bool) -> Iterator[tuple[str, object]]:
        if first:
            yield from (("/events/bumper", bumper_event(bumper, 0)) for bumper in range(3))
        if (wall_m < TOUCHING_M) != self.pressed:
            self.pressed = not self.pressed
            yield "/events/bumper", bumper_event(1, int(self.pressed))


def sonars(t_ns: int, wall_m: float, _first: bool) -> Iterator[tuple[str, object]]:
    yield "/sonar/left", sonar(t_ns, math.inf)
    yield "/sonar/center", sonar(t_ns, wall_m if wall_m < 4.0 else math.inf)
    yield "/sonar/right", sonar(t_ns, 4.0)


def drive(configuration: RobotConfiguration, sense: Sense) -> Iterator[Message]:
    picture = np.random.default_rng(0).integers(0, 255, (60, 80, 3), np.uint8)
    camera = configuration.camera[0]
    for i, x_m in enumerate(path_m()):
        t_ns = 10**9 + i * STEP_NS
        said = [("/odom", messages.odometry(OdometrySample(t_ns, np.array([x_m, 0.0, 0.0]))))]
        said += sense(t_ns, WALL_M - x_m, i == 0)
        if i % 4 == 0:
            raw = camera.type == "sensor_msgs/msg/Image"
            picture = np.roll(picture, 1, 1)
            said.append(
                (f"/{camera.topic}", messages.image(t_ns, picture) if raw else messages.compressed_image(t_ns, picture))
            )
        for topic, message in said:
            yield Message(topic, message.__msgtype__, t_ns, messages.encode(message))


def as_mcap(path: Path, found: list[Message]) -> Path:
    with Writer(path / "walk.mcap", messages.definition) as writer:
        for message in found:
            writer.write(message)
    return path / "walk.mcap"


ROBOTS = {
    "turtlebot4": (turtlebot4, as_mcap, ["ir_front_center_left", "bumper"], [0.1, TOUCHING_M]),
    "turtlebot3": (turtlebot3, lambda path, found: write_ros2(path / "walk", found, "sqlite3"), ["center"], [0.4]),
    "kobuki": (Kobuki(), as_mcap, ["center"], [TOUCHING_M]),
    "sonar": (sonars, lambda path, found: write_ros1(path / "walk.bag", found), ["center"], [0.3]),
}


@pytest.mark.parametrize("name", ROBOTS)
def test_its_own_messages_are_understood_and_label_what_lies_ahead(tmp_path, name):
    sense, write, sensors, reaches_m = ROBOTS[name]
    configuration = load(ROOT / f"configs/{name}.toml")
    recording = write(tmp_path, list(drive(configuration, sense)))
    assert [f for f in check(read(recording), configuration) if f.severity == "error"] == []
    shape = configuration.outputs
    arrays = as_arrays(labels_of(configuration, recording), shape)
    frames_m = np.array(path_m())[::4]
    targets_m = configuration.targets.build().poses[:, 0]
    ahead_m = WALL_M - (frames_m[:, None] + targets_m)
    assert len(arrays["t"]) == len(frames_m)
    hair = configuration.labels.position_tolerance_m + STEP_M
    for sensor, reach_m in zip(sensors, reaches_m, strict=True):
        labels = arrays["labels"][:, :, configuration.sensors.index(sensor)]
        near, far = (ahead_m < reach_m - hair) & (ahead_m > 0.13), ahead_m > reach_m + hair
        assert (labels[far] != 1).all()
        assert (labels[near] != 0).all()
        assert (labels == 1).any()
        assert (labels[far] == 0).sum() > 1000
        if near.any():
            assert (labels[near] == 1).sum() > 50


def test_commands_go_where_and_as_the_robot_takes_them():
    for name, topic, kind in (
        ("turtlebot4", "cmd_vel", "geometry_msgs/msg/TwistStamped"),
        ("kobuki", "commands/velocity", "geometry_msgs/msg/Twist"),
    ):
        configuration = load(ROOT / f"configs/{name}.toml")
        assert ros_names(configuration).name(f"{name}/cmd_vel") == topic
        assert types_of(configuration)[f"{name}/cmd_vel"] == kind
