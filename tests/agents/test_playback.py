import math
import threading
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents import messages
from agents.robots.playback import Playback, schedule
from agents.transport import Received, free_endpoint, open_session, subscribe_all
from llrp_online.configuration import load
from llrp_online.events import OdometrySample
from replay.recording import Message, RecordingError, Writer, read
from tests.agents import processes

pytestmark = pytest.mark.live

#: What goes over a bus takes no longer.
until = partial(processes.until, timeout_s=5.0)

ROOT = Path(__file__).parents[2]
DATA = ROOT.parent / "shared" / "data"
needs_data = pytest.mark.skipif(not DATA.exists(), reason=f"the real recordings are not at {DATA}")
DRONE = load(ROOT / "configs" / "drone.toml")
ODOMETRY = "nav_msgs/msg/Odometry"


def recorded(path: Path, *topics: str, count: int = 10, step_ns: int = 50_000_000) -> Path:
    with Writer(path, messages.definition) as writer:
        for i in range(count):
            data = messages.encode(messages.odometry(OdometrySample(i * step_ns, np.zeros(3))))
            for topic in topics:
                writer.write(Message(topic, ODOMETRY, i * step_ns, data))
    return path


@given(times_ns=st.lists(st.integers(0, 2**62), min_size=1).map(sorted), speed=st.floats(0.1, 100))
def test_the_schedule_is_the_sensors_own_at_another_pace(times_ns, speed):
    parts = [Message("/t", "T", t_ns, b"") for t_ns in times_ns]
    plan = list(schedule(parts, speed))
    assert [message for _, message in plan] == parts
    assert [due_s for due_s, _ in plan] == pytest.approx([(t_ns - times_ns[0]) / 1e9 / speed for t_ns in times_ns])
    assert all(due_s == 0 for due_s, _ in schedule(parts, math.inf))


@pytest.mark.parametrize("speed", [0.0, -1.0, math.nan])
def test_a_speed_that_is_none_is_an_error(speed):
    with pytest.raises(ValueError, match="expected a number above 0"):
        next(schedule([Message("/t", "T", 0, b"")], speed))


@needs_data
def test_a_real_recording_plays_whole_to_whoever_listens():
    path = DATA / "drone" / "A0.mcap"
    where = free_endpoint()
    with open_session(where) as first, open_session(where) as second:
        found: list[Received] = []
        with subscribe_all(second, "drone", found.append):
            robot = Playback(first, DRONE, path, math.inf)
            time.sleep(0.2)  # for the subscription to get around
            assert robot.run(threading.Event()) is None
            assert robot.played == 520
            until(lambda: len(found) >= 510, "what was played")
            robot.close()
        for name in ("odom", "range"):
            played = [(m.type, m.data) for m in found if m.key == f"drone/{name}"]
            assert played == [(m.type, m.data) for m in read(path) if m.topic == f"/{name}"]
        pictures = {m.data for m in read(path) if m.topic == "/camera/image/compressed"}
        seen = {m.data for m in found if m.key.startswith("drone/camera")}
        assert seen <= pictures
        assert len(seen) > 0.9 * len(pictures)


def test_it_keeps_the_pace(tmp_path):
    path = recorded(tmp_path / "run.mcap", "/drone/odom", count=21)  # one second of it
    with open_session(free_endpoint()) as session:
        robot = Playback(session, DRONE, path, speed=4.0)
        before_s = time.monotonic()
        robot.run(threading.Event())
        took_s = time.monotonic() - before_s
    assert 0.24 < took_s < 0.6
    assert robot.played == 21
    assert robot.late_s < 0.3


def test_what_agents_said_is_not_said_again_and_what_lacks_is_named(tmp_path, caplog):
    path = recorded(tmp_path / "run.mcap", "/drone/odom", "/drone/cmd_vel", "/drone/prediction")
    with open_session(free_endpoint()) as session:
        robot = Playback(session, DRONE, path, math.inf)
        missing = robot.run(threading.Event())
    assert robot.played == 10
    assert missing is not None
    assert missing.topics == ("range", "camera/image/compressed")
    assert "/drone/cmd_vel (nav_msgs/msg/Odometry)" in caplog.text


def test_it_stops_when_told_to(tmp_path):
    path = recorded(tmp_path / "run.mcap", "odom", step_ns=60 * 10**9)
    with open_session(free_endpoint()) as session:
        stop = threading.Event()
        threading.Timer(0.1, stop.set).start()
        before_s = time.monotonic()
        assert Playback(session, DRONE, path).run(stop) is None
        assert time.monotonic() - before_s < 1.0


def test_a_recording_that_is_none_is_an_error_at_once(tmp_path):
    with open_session(free_endpoint()) as session, pytest.raises(RecordingError, match="cannot be read"):
        Playback(session, DRONE, tmp_path / "none.mcap")
