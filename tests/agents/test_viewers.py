"""What is recorded opens elsewhere: readers that are not ours decode every topic by the definitions in the file."""

import json
import re
import shutil
import subprocess
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from agents import messages, status, topics
from agents.behaviours import controller
from agents.extras import install
from agents.recorder import Recorder
from agents.robots.simulated import load_scenario
from agents.robots.wire import Wire
from agents.rollout import rollout
from agents.simulated_drive import simulated_robot
from agents.transport import Stream, free_endpoint, open_session
from llrp_online.configuration import load
from llrp_online.prequential import Band
from llrp_online.status import LearnerStatus
from replay.recording import read
from tests.agents.processes import until

pytestmark = pytest.mark.live

CONFIGURATION = load("configs/thymio.toml")
LAYOUT = Path("configs/foxglove-layout.json")
TARGETS, SENSORS = CONFIGURATION.targets.build().poses, CONFIGURATION.sensors
STATUS = LearnerStatus(
    1.0, 10, 2, 8, [3], [1], 8, 4, 0.0, 0.25, 1, 0.5, 0, [Band(0.0, 0.3, 0.9, 0.1, 4, 40)], 0, {}, paused=False
)


def spoken() -> list[tuple[str, str, bytes]]:
    """A second of a simulated robot, and one of each thing that agents say of it: topic, type, bytes."""
    robot = simulated_robot(CONFIGURATION, load_scenario("configs/scenarios/tiles.toml"), 0)
    drive = rollout(robot, controller("explore", CONFIGURATION, 0), CONFIGURATION, 1.0)
    wire = Wire(CONFIGURATION)
    said = [(m.topic.removeprefix("/thymio/"), m.type, m.data) for moment in drive for m in wire.messages(moment)]
    probabilities = np.linspace(0, 1, len(TARGETS) * len(SENSORS)).reshape(len(TARGETS), -1)
    labels = np.where(probabilities > 0.9, -1, probabilities > 0.5).astype(np.int8)
    seen = messages.prediction(5, TARGETS, SENSORS, probabilities)
    felt = messages.labels(5, TARGETS, SENSORS, labels, probabilities)
    return [
        *said,
        (
            topics.PREDICTION,
            topics.CLOUD_TYPE,
            messages.encode(seen),
        ),
        (topics.LABELS, topics.CLOUD_TYPE, messages.encode(felt)),
        (topics.LEARNER_STATUS, topics.STATUS_TYPE, status.encode_learner(STATUS, 5)),
        (topics.COMMAND, topics.COMMAND_TYPE, messages.encode(messages.twist(0.1, 0.2))),
    ]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Path:
    """What `llrp record` writes of a robot that says all that robots and agents say."""
    path, said = tmp_path_factory.mktemp("viewers") / "run.mcap", spoken()
    endpoint = free_endpoint()
    with (
        open_session(endpoint, hub=True) as robot,
        open_session(endpoint, hub=False) as listener,
        Recorder(listener, "thymio", path) as recorder,
    ):
        # All as streams, which lose nothing: what is tried here is what the file says.
        kinds = {topic: kind for topic, kind, _ in said}
        publishers = {topic: Stream(robot, f"thymio/{topic}", kind) for topic, kind in kinds.items()}
        time.sleep(0.3)
        for topic, _, data in said:
            publishers[topic].put(data)
        until(lambda: recorder.messages == len(said), "all that was said")
    return path


def decoded(path):
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        return [(schema, channel, message) for schema, channel, _, message in reader.iter_decoded_messages()]


def test_the_mcap_library_decodes_every_topic_by_the_definitions_in_the_file(recorded):
    found = decoded(recorded)
    assert Counter(channel.topic for _, channel, _ in found) == Counter(message.topic for message in read(recorded))
    assert {(s.encoding, c.message_encoding) for s, c, _ in found} == {("ros2msg", "cdr")}
    assert len({c.topic for _, c, _ in found}) == 7
    by_topic = {channel.topic: message for _, channel, message in found}
    image = by_topic["/thymio/camera/image/compressed"]
    assert (image.format, bytes(image.data[:2])) == ("jpeg", b"\xff\xd8")
    assert len(by_topic["/thymio/range"].ranges) == 5
    assert by_topic["/thymio/odom"].child_frame_id == "base_link"
    assert by_topic["/thymio/cmd_vel"].angular.z == 0.2


def test_clouds_have_a_point_a_target_and_a_field_a_sensor(recorded):
    clouds = {c.topic: m for s, c, m in decoded(recorded) if s.name == topics.CLOUD_TYPE}
    for topic, extra in (("/thymio/prediction", []), ("/thymio/labels", [f"{name}_weight" for name in SENSORS])):
        cloud = clouds[topic]
        assert [field.name for field in cloud.fields] == ["x", "y", "z", "yaw", *SENSORS, *extra]
        assert {(field.datatype, field.count) for field in cloud.fields} == {(7, 1)}  # float32
        assert (cloud.width, cloud.height, cloud.header.frame_id) == (31, 1, "base_link")
        table = np.frombuffer(bytes(cloud.data), "<f4").reshape(31, -1)
        np.testing.assert_allclose(table[:, 0], TARGETS[:, 0], atol=1e-6)
    assert not clouds["/thymio/labels"].is_dense  # unknown is NaN


def test_the_status_is_one_key_a_figure(recorded):
    [array] = [m for s, c, m in decoded(recorded) if c.topic == "/thymio/learner/status"]
    assert [one.name for one in array.status] == ["learner"]
    assert {"loss": "0.25", "steps": "4"}.items() <= {v.key: v.value for v in array.status[0].values}.items()


@pytest.mark.skipif(
    shutil.which("rerun") is None,
    reason="no `rerun` to open the recording with: pip install rerun-sdk, 490 MB, and put its folder on PATH",
)
def test_rerun_opens_every_topic(recorded, tmp_path):
    checked = subprocess.run(["rerun", "mcap", "check", recorded], capture_output=True, text=True, check=True).stdout
    assert len(re.findall(r"^ok .*/thymio/", checked, re.MULTILINE)) == 7, checked
    rrd = tmp_path / "run.rrd"
    subprocess.run(["rerun", "mcap", "convert", recorded, "-o", rrd], capture_output=True, check=True)
    shown = subprocess.run(["rerun", "rrd", "print", "-vv", rrd], capture_output=True, text=True, check=True).stdout
    rows: Counter[tuple[str, str]] = Counter()
    for block in shown.split("\nChunk(")[1:]:
        entity = re.search(r" - (\S+) - ", block)[1]
        count = int(re.search(r"with (\d+) rows", block)[1])
        rows.update(dict.fromkeys([(entity, name) for name in re.findall(r"component: (\S+)", block)], count))
    expected = Counter(message.topic for message in read(recorded))
    shows = {
        "/thymio/camera/image/compressed": "EncodedImage:blob",
        "/thymio/prediction": "Points3D:center_left",
        "/thymio/labels": "Points3D:center_left_weight",
        "/thymio/learner/status": "diagnostic_msgs.msg.DiagnosticArray:message",
        "/thymio/odom": "nav_msgs.msg.Odometry:message",
        "/thymio/range": "sensor_msgs.msg.LaserScan:message",
        "/thymio/cmd_vel": "geometry_msgs.msg.Twist:message",
    }
    assert {topic: rows[topic, component] for topic, component in shows.items()} == expected


def panels():
    return json.loads(LAYOUT.read_text(encoding="utf-8"))["configById"]


def test_the_layout_shows_topics_that_there_are():
    wanted = set(re.findall(r'"(/thymio/[a-z/_]+)', LAYOUT.read_text(encoding="utf-8")))
    there = {f"/thymio/{topic}" for topic, _, _ in spoken()} | {f"/thymio/{topics.PERCEIVER_STATUS}"}
    assert wanted == there - {"/thymio/cmd_vel"}
    keys = re.findall(r'key==\\"(\w+)\\"', LAYOUT.read_text(encoding="utf-8"))
    assert {"loss", "frames", "labelled", "steps"} == set(keys)
    assert set(keys) <= set(vars(STATUS))
    fields = {c["colorField"] for p in panels().values() for c in p.get("topics", {}).values() if "colorField" in c}
    assert fields <= set(SENSORS)


def test_the_layout_places_each_panel_once():
    def leaves(node):
        return [node] if isinstance(node, str) else leaves(node["first"]) + leaves(node["second"])

    layout = json.loads(LAYOUT.read_text(encoding="utf-8"))
    assert sorted(leaves(layout["layout"])) == sorted(layout["configById"])


def test_the_layout_has_only_settings_that_foxglove_knows():
    layouts = pytest.importorskip("foxglove.layouts", reason=install("foxglove"))
    configs = {
        "Image": layouts.ImageConfig,
        "3D": layouts.ThreeDeeConfig,
        "Plot": layouts.PlotConfig,
        "DiagnosticStatusPanel": layouts.DiagnosticsDetailConfig,
    }
    for name, panel in panels().items():
        known = set(configs[name.partition("!")[0]]()._to_dict())
        assert set(panel) - known == {"foxglovePanelTitle"}, name
        for path in panel.get("paths", []):
            assert set(path) <= set(layouts.PlotSeries()._to_dict())
        for topic in panel.get("topics", {}).values():
            assert set(topic) <= set(layouts.BaseRendererPointCloudTopicSettings()._to_dict())
        assert set(panel.get("cameraState", {})) <= set(layouts.ThreeDeeCameraState()._to_dict())
