"""What topics are called on the wire, in each dialect, between our own sessions and as a stranger sees it."""

import struct
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents import messages
from agents.naming import naming_of
from agents.transport import (
    Frames,
    Naming,
    Plain,
    Received,
    Ros2Dds,
    Ros2Zenoh,
    RosNames,
    Session,
    State,
    Stream,
    free_endpoint,
    open_session,
    subscribe_all,
    subscribe_latest,
    subscribe_state,
    subscribe_stream,
)
from llrp_online.configuration import load
from replay.recording import read
from tests.agents.processes import ROOT, WAIT_S, Agents, quick_configuration, until

pytestmark = pytest.mark.live

BOOL, ODOMETRY = "std_msgs/msg/Bool", "nav_msgs/msg/Odometry"
TYPES = {"rover/odom": ODOMETRY, "rover/bump/left": BOOL, "rover/status": BOOL}
DIALECTS = {
    "plain": Plain(TYPES),
    "dds": Ros2Dds(RosNames("rover"), TYPES),
    "dds, in a namespace": Ros2Dds(RosNames("rover", "fleet/rover"), TYPES),
    "zenoh": Ros2Zenoh(RosNames("rover"), TYPES, messages.type_hash),
    "zenoh, in a namespace": Ros2Zenoh(RosNames("rover", "rover"), TYPES, messages.type_hash, 42),
}
TRUE = bytes([0, 1, 0, 0, 1])


@pytest.fixture(params=DIALECTS)
def dialect(request) -> Naming:
    return DIALECTS[request.param]


@contextmanager
def pair(naming: Naming) -> Iterator[tuple[Session, Session]]:
    where = free_endpoint()
    with (
        open_session(where, name="first", naming=naming) as first,
        open_session(where, name="second", naming=naming) as second,
    ):
        until(lambda: first.zenoh.info.peers_zid(), "the other peer")
        yield first, second


names = st.from_regex(r"[a-z][a-z0-9_]{0,9}(/[a-z][a-z0-9_]{0,9}){0,3}", fullmatch=True)


@given(topic=names, kind=st.sampled_from([BOOL, ODOMETRY, "sensor_msgs/msg/Image"]))
def test_what_is_published_is_read_as_it_was_named_and_matches_what_is_subscribed(topic, kind):
    import zenoh

    key = f"rover/{topic}"
    for naming in (
        Plain({key: kind}),
        Ros2Dds(RosNames("rover", "ns"), {key: kind}),
        Ros2Zenoh(RosNames("rover", "ns/a", {topic: "elsewhere"}), {key: kind}, messages.type_hash, 3),
        Ros2Zenoh(RosNames("rover"), {key: kind}, messages.type_hash),
    ):
        wire = naming.published(key, kind)
        assert naming.read(wire) == (key, kind)
        assert zenoh.KeyExpr(naming.subscribed(key)).intersects(zenoh.KeyExpr(wire))
        assert zenoh.KeyExpr(naming.everything("rover")).intersects(zenoh.KeyExpr(wire))


def test_keys_are_those_of_rmw_zenoh_and_of_the_bridge():
    odometry = "nav_msgs::msg::dds_::Odometry_/RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"
    assert DIALECTS["zenoh"].published("rover/odom", ODOMETRY) == f"0/odom/{odometry}"
    assert DIALECTS["zenoh, in a namespace"].published("rover/odom", ODOMETRY) == f"42/rover/odom/{odometry}"
    assert DIALECTS["dds, in a namespace"].published("rover/odom", ODOMETRY) == "fleet/rover/odom"
    for name in ("zenoh", "dds", "plain"):
        assert DIALECTS[name].published("rover/learner/weights", "") == "rover/learner/weights"
        assert DIALECTS[name].subscribed("rover/learner/weights") == "rover/learner/weights"


@pytest.mark.parametrize("wire", ["0/odom", "odom", "1/odom/std_msgs::msg::dds_::Bool_/RIHS01_0", "0/a/b::c/RIHS01_0"])
def test_a_key_of_another_shape_or_domain_has_no_type(wire):
    assert DIALECTS["zenoh"].read(wire) == (wire, "")


def test_every_kind_of_topic_gets_through(dialect):
    with pair(dialect) as (first, second):
        heard: dict[str, list[Received]] = {"stream": [], "latest": [], "state": [], "weights": [], "all": []}
        with (
            Stream(first, "rover/odom", ODOMETRY) as odometry,
            Frames(first, "rover/bump/left", BOOL) as bump,
            State(first, "rover/status", BOOL) as status,
            State(first, "rover/learner/weights", "") as weights,
        ):
            for publisher in (odometry, status, weights):
                publisher.put(TRUE)  # those who join later get it all the same
            subscribe_stream(second, "rover/odom", heard["stream"].append)
            subscribe_latest(second, "rover/bump/left", heard["latest"].append)
            subscribe_state(second, "rover/status", heard["state"].append)
            subscribe_state(second, "rover/learner/weights", heard["weights"].append)
            everything = subscribe_all(second, "rover", heard["all"].append)
            until(lambda: heard["stream"] and heard["state"] and heard["weights"], "what was said before")
            until(lambda: bump.put(TRUE) or heard["latest"], "a frame")
            for _ in range(200):
                odometry.put(TRUE)
            until(lambda: len(heard["stream"]) == 201, "all of the stream")
            assert {(m.key, m.type, m.data) for m in heard["stream"]} == {("rover/odom", ODOMETRY, TRUE)}
            assert {(m.key, m.type) for m in heard["latest"]} == {("rover/bump/left", BOOL)}
            assert [(m.key, m.type) for m in heard["state"]] == [("rover/status", BOOL)]
            assert [(m.key, m.type) for m in heard["weights"]] == [("rover/learner/weights", "")]
            until(lambda: sum(m.key == "rover/odom" for m in heard["all"]) == 200, "all of the stream, to all")
            assert everything.missed == 0
            if not isinstance(dialect, Ros2Dds):
                sequences = [m.sent.sequence for m in heard["stream"] if m.sent]
                assert sequences == list(range(sequences[0], sequences[0] + 201))
                assert all(0 <= m.age_s() < 60 for m in heard["stream"])


def test_the_type_named_with_a_message_is_the_type_of_its_key():
    with pair(DIALECTS["zenoh"]) as (first, second):
        found: list[Received] = []
        subscribe_stream(second, "rover/odom", found.append)
        with Stream(first, "rover/odom", "") as stream:
            stream.put(b"1")
            stream.put(b"2", BOOL)
            until(lambda: len(found) == 2, "both")
    assert [(m.key, m.type) for m in found] == [("rover/odom", ODOMETRY), ("rover/odom", BOOL)]


def test_another_releases_hash_is_heard_and_lost_messages_of_two_publishers_are_told_apart():
    with pair(DIALECTS["zenoh"]) as (first, second):
        found: list[Received] = []
        subscription = subscribe_latest(second, "rover/bump/left", found.append)
        time.sleep(0.1)
        wire = "0/bump/left/std_msgs::msg::dds_::Bool_/TypeHashNotSupported"
        for sequence, publisher in ((7, b"a"), (90, b"b"), (8, b"a"), (91, b"b"), (93, b"b")):
            attachment = struct.pack("<qqB", sequence, time.time_ns(), 16) + publisher * 16
            count = len(found)
            first.zenoh.put(wire, TRUE, attachment=attachment)
            until(lambda count=count: len(found) > count, "it")
        assert {(m.key, m.type) for m in found} == {("rover/bump/left", BOOL)}
        assert subscription.missed == 1


def test_ros_2_sees_nodes_publishers_and_subscriptions_come_and_go():
    def graph() -> set[str]:
        replies = second.zenoh.liveliness().get("@ros2_lv/42/**", timeout=2.0)
        return {"/".join(str(r.ok.key_expr).split("/")[5:]) for r in replies if r.ok is not None}

    hashed = messages.type_hash(BOOL)
    nodes = {"NN/%/%/llrp_first", "NN/%/%/llrp_second"}
    with pair(DIALECTS["zenoh, in a namespace"]) as (first, second):
        until(lambda: graph() == nodes, "both nodes")
        topic = f"%rover%bump%left/std_msgs::msg::dds_::Bool_/{hashed}"
        with (
            Frames(first, "rover/bump/left", BOOL),
            State(first, "rover/learner/weights", ""),
            subscribe_latest(second, "rover/bump/left", lambda _: None),
            subscribe_state(second, "rover/learner/weights", lambda _: None),
        ):
            frames = f"MP/%/%/llrp_first/{topic}/2::,1:,:,:,,"
            ends = f"MS/%/%/llrp_second/{topic}/2::,1:,:,:,,"
            until(lambda: graph() == nodes | {frames, ends}, "both ends")
        until(lambda: graph() == nodes, "both ends gone")


@pytest.mark.parametrize(
    ("mapping", "wire"),
    [("plain", "thymio/odom"), ("ros2-dds", "bot1/odom"), ("ros2-zenoh", "5/bot1/odom/*/*")],
)
def test_the_configuration_chooses(tmp_path, mapping, wire):
    path = tmp_path / "robot.toml"
    keys = f'\n[keys]\nmapping = "{mapping}"\ndomain = 5\nnamespace = "bot1"\n'
    path.write_text((ROOT / "configs/thymio.toml").read_text() + keys)
    naming = naming_of(load(path))
    assert naming.subscribed("thymio/odom") == wire
    assert naming.type_of("thymio/range") == "sensor_msgs/msg/LaserScan"
    assert naming.type_of("thymio/prediction") == "sensor_msgs/msg/PointCloud2"
    assert naming.subscribed("thymio/learner/command") == "thymio/learner/command"


def test_a_sender_that_names_no_type_is_read_as_the_configuration_says(dialect):
    """A plain ROS 2 bridge on Zenoh hands over the bytes alone."""
    with pair(dialect) as (first, second):
        found: list[Received] = []
        subscribe_latest(second, "rover/odom", found.append)
        until(lambda: first.zenoh.put(dialect.published("rover/odom", ODOMETRY), TRUE) or found, "it")
    assert found[0] == Received("rover/odom", ODOMETRY, TRUE, None)


@pytest.mark.slow
@pytest.mark.parametrize("mapping", ["ros2-zenoh", "ros2-dds"])
def test_all_agents_work_together_under_ros_2_names(tmp_path, mapping):
    config = quick_configuration(tmp_path)
    config.write_text(config.read_text() + f'\n[keys]\nmapping = "{mapping}"\ndomain = 9\nnamespace = "bot1"\n')
    with Agents(tmp_path, config) as agents:
        agents.start("robot", "robot", "--speed", "2")
        agents.start("recorder", "record", "--output", str(tmp_path / "run.mcap"))
        agents.start("learner", "learn", "--output", str(tmp_path / "run"))
        agents.start("perceiver", "perceive")
        agents.start("controller", "control")
        agents.wait_present("robot", "recorder", "learner", "perceiver", "controller")
        until(lambda: agents.perceiver is not None and agents.perceiver.frames > 20, "predictions")
        until(agents.is_driving, "driving")
        until(lambda: agents.learner is not None and agents.learner.steps > 0, "learning")
        assert all(agents.counts.values()), agents.counts
        agents.start("check", "check", "--live", "--seconds", "3")
        agents.processes["check"].wait(WAIT_S)
        assert "left: " in agents.said("check")
        assert "no message" not in agents.said("check")
        agents.end("recorder")
    found = list(read(tmp_path / "run.mcap"))
    kinds = {message.topic: message.type for message in found}
    assert kinds["/thymio/odom"] == ODOMETRY
    assert kinds["/thymio/cmd_vel"] == "geometry_msgs/msg/Twist"
    assert kinds["/thymio/prediction"] == kinds["/thymio/labels"] == "sensor_msgs/msg/PointCloud2"
    assert {"/thymio/range", "/thymio/camera/image/compressed", "/thymio/learner/status"} <= set(kinds)
