"""A configuration for a stranger's recording: it loads, checks without an error, and labels."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from agents import cli, messages
from agents.checks import Survey, check, propose
from agents.commands.label import as_arrays
from agents.offline import labels_of
from llrp_online.configuration import RobotConfiguration, load
from replay.recording import Message, read
from tests.agents.processes import ROOT
from tests.agents.test_ready_robots import ROBOTS, drive
from tests.replay.bags import write_ros2

DATA = ROOT.parent / "shared/data"
needs_data = pytest.mark.skipif(not DATA.exists(), reason=f"the real recordings are not at {DATA}")


def proposed(recording: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> RobotConfiguration:
    assert cli.main(["check", str(recording)]) == 0
    (folder / "proposed.toml").write_text(capsys.readouterr().out)
    return load(folder / "proposed.toml")


@pytest.mark.parametrize("name", ROBOTS)
def test_a_robot_whose_messages_are_known_is_found_as_its_ready_configuration_has_it(tmp_path, name, capsys):
    sense, write, _, _ = ROBOTS[name]
    ready = load(ROOT / f"configs/{name}.toml")
    recording = write(tmp_path, list(drive(ready, sense)))
    found = proposed(recording, tmp_path, capsys)
    assert found.camera[0].topic == ready.camera[0].topic
    assert found.camera[0].type == ready.camera[0].type
    assert found.odometry.topic == "odom"
    assert found.odometry.max_speed_m_s == pytest.approx(0.3)
    assert set(found.range_topics) == set(ready.range_topics)
    fields = {(sensor.topic, sensor.field) for sensor in found.short_range}
    assert {(sensor.topic, sensor.field) for sensor in ready.short_range} <= fields
    assert [f for f in check(read(recording), found) if f.severity == "error"] == []
    shape = len(found.targets.build()), len(found.sensors)
    assert (as_arrays(labels_of(found, recording), shape)["labels"] >= 0).any()


@needs_data
@pytest.mark.parametrize(("recording", "sensors"), [("drone/R0.mcap", 4), ("nao/2013062101.mcap", 2)])
def test_a_real_recording_is_found(tmp_path, recording, sensors, capsys):
    found = proposed(DATA / recording, tmp_path, capsys)
    assert len(found.sensors) == sensors
    shape = len(found.targets.build()), sensors
    labels = as_arrays(labels_of(found, DATA / recording), shape)["labels"]
    assert (labels == 1).any()
    assert (labels == 0).any()


def test_names_tell_the_better_of_two_and_a_namespace_is_taken_off():
    survey = Survey()
    ready = load(ROOT / "configs/turtlebot3.toml")
    depth = messages.encode(messages.image(0, np.zeros((8, 8, 3), np.uint8))).replace(b"rgb8", b"16UC")
    for message in drive(ready, ROBOTS["turtlebot3"][0]):
        moved = message._replace(topic=f"/bot1{message.topic}")
        survey.add(moved)
        if moved.topic == "/bot1/odom":
            survey.add(moved._replace(topic="/bot1/ground_truth/odom"))
        if moved.topic == "/bot1/camera/image_raw":
            survey.add(moved._replace(topic="/bot1/camera/depth/image_raw", data=depth))
            survey.add(moved._replace(topic="/bot1/rear/image_raw"))
    survey.add(Message("/tf", "tf2_msgs/msg/TFMessage", 5, b"\0\1\0\0"))
    survey.add(Message("/bot1/scan", "sensor_msgs/msg/LaserScan", 5, b"damaged"))
    text = propose(survey, "walk").toml
    assert 'name = "bot1"' in text
    assert 'namespace = "bot1"' in text
    assert 'topic = "camera/image_raw"' in text
    assert '\ntopic = "odom"' in text
    assert "#   /bot1/camera/depth/image_raw  sensor_msgs/msg/Image, " in text
    assert "encoding '16UC'" in text
    assert "#   /tf  tf2_msgs/msg/TFMessage" in text


def test_what_is_missing_is_said(tmp_path):
    ready = load(ROOT / "configs/sonar.toml")
    found = [m for m in drive(ready, ROBOTS["sonar"][0]) if "image" not in m.topic]
    bag = write_ros2(tmp_path / "walk", found)
    run = [sys.executable, "-m", "agents.cli", "check", str(bag)]
    said = subprocess.run(run, capture_output=True, text=True, check=False, cwd=ROOT)
    assert said.returncode == 1
    assert said.stdout == ""
    assert "no configuration can be proposed\n  camera: no topic with pictures that can be decoded" in said.stderr
    assert "what there is: /odom (nav_msgs/msg/Odometry), /sonar/center (sensor_msgs/msg/Range)" in said.stderr
    told = subprocess.run([*run, "--json"], capture_output=True, text=True, check=False, cwd=ROOT)
    assert told.returncode == 1
    assert json.loads(told.stdout)["topics"]["/odom"]["type"] == "nav_msgs/msg/Odometry"


def test_live_wants_a_configuration(capsys):
    assert cli.main(["check", "--live"]) == 2
    assert "--live needs --config" in capsys.readouterr().err
