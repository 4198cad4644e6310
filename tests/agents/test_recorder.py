import threading
import time
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents import messages
from agents.recorder import Recorder, SensorClock
from agents.transport import Frames, State, Stream, free_endpoint, open_session
from llrp_online.events import OdometrySample
from replay.recording import RecordingError, read
from tests.agents import processes

pytestmark = pytest.mark.live

#: What goes over a bus takes no longer.
until = partial(processes.until, timeout_s=5.0)

SECOND_NS = 10**9
SCAN = "sensor_msgs/msg/LaserScan"
ODOMETRY = "nav_msgs/msg/Odometry"


def scan(t_ns: int) -> bytes:
    return messages.encode(messages.laser_scan(t_ns, [1.0], (0.0, 0.0), (0.0, 4.0)))


def odometry(t_ns: int) -> bytes:
    return messages.encode(messages.odometry(OdometrySample(t_ns, np.zeros(3))))


COMMAND = messages.encode(messages.twist(0.1, 0.0))
TWIST = "geometry_msgs/msg/Twist"


def test_the_clock_is_the_newest_stamp_of_a_sensor():
    clock = SensorClock()
    assert clock.log_ns("cmd_vel", TWIST, COMMAND) is None
    assert clock.log_ns("range", SCAN, scan(5 * SECOND_NS)) == 5 * SECOND_NS
    assert clock.log_ns("odom", ODOMETRY, odometry(4_900_000_000)) == 5 * SECOND_NS  # a little late
    assert clock.log_ns("cmd_vel", TWIST, COMMAND) == 5 * SECOND_NS
    cloud = messages.encode(messages.prediction(SECOND_NS, [[0.0, 0.0, 0.0]], ["left"], [[0.5]]))
    assert clock.log_ns("prediction", "sensor_msgs/msg/PointCloud2", cloud) == 5 * SECOND_NS
    assert clock.log_ns("odom", ODOMETRY, odometry(6 * SECOND_NS)) == 6 * SECOND_NS


def test_a_clock_set_back_goes_on_at_its_own_pace():
    clock = SensorClock()
    stamps_s = [100, 101, 20, 21, 22]
    assert [clock.log_ns("range", SCAN, scan(s * SECOND_NS)) for s in stamps_s] == [
        s * SECOND_NS for s in (100, 101, 101, 102, 103)
    ]
    # A sensor of another clock altogether comes in step with the others.
    assert clock.log_ns("odom", ODOMETRY, odometry(10**18)) == 103 * SECOND_NS
    assert clock.log_ns("odom", ODOMETRY, odometry(10**18 + SECOND_NS)) == 104 * SECOND_NS


@given(st.lists(st.tuples(st.sampled_from("abc"), st.integers(-(10**12), 10**12)), max_size=40))
def test_log_times_never_go_back(stamps):
    clock = SensorClock()
    times = [clock.log_ns(name, SCAN, scan(t_ns)) for name, t_ns in stamps]
    assert times == sorted(times)
    assert all(t_ns >= 0 for t_ns in times)


def test_everything_of_a_robot_is_recorded_with_its_type(tmp_path):
    path = tmp_path / "run.mcap"
    where = free_endpoint()
    with open_session(where) as first, open_session(where) as second:
        with (
            Frames(first, "bot/cmd_vel", TWIST) as command,
            Stream(first, "bot/range", SCAN) as ranges,
            Stream(first, "bot/odom", ODOMETRY) as poses,
            State(first, "bot/learner/weights", "") as weights,
            Stream(first, "bot2/range", SCAN) as other,
            Recorder(second, "bot", path) as recorder,
        ):
            time.sleep(0.1)
            command.put(COMMAND)  # before any sensor has spoken
            until(lambda: len(recorder._before_clock) == 1, "a message before the clock")
            for i in range(200):
                ranges.put(scan(i * 50_000_000))
                poses.put(odometry(i * 50_000_000))
                other.put(scan(0))
            weights.put(b"safetensors")
            command.put(COMMAND)
            until(lambda: recorder.messages == 402, "all that was sent")
        assert not recorder.drops
        assert recorder.missed == 0
        assert recorder.error is None
    reader = read(path)
    found = list(reader)
    assert reader.report.finished
    assert {(m.topic, m.type) for m in found} == {
        ("/bot/cmd_vel", TWIST),
        ("/bot/range", SCAN),
        ("/bot/odom", ODOMETRY),
    }
    stamped = [m for m in found if m.type == SCAN]
    assert [m.data for m in stamped] == [scan(i * 50_000_000) for i in range(200)]
    assert all(m.log_ns >= (messages.stamp_ns(m.type, m.data) or 0) for m in stamped)
    assert next(m.log_ns for m in found if m.type == TWIST) < SECOND_NS


def test_only_commands_are_recorded_by_the_wall_clock(tmp_path):
    where = free_endpoint()
    with (
        open_session(where) as first,
        open_session(where) as second,
        Frames(first, "bot/cmd_vel", TWIST) as command,
        Recorder(second, "bot", tmp_path / "run.mcap") as recorder,
    ):
        time.sleep(0.1)
        command.put(COMMAND)
        until(lambda: len(recorder._before_clock) == 1, "a message before the clock")
    [message] = read(tmp_path / "run.mcap")
    assert abs(message.log_ns - time.time_ns()) < 60 * SECOND_NS


def test_a_slow_disk_costs_messages_and_never_keeps_the_bus_waiting(tmp_path, monkeypatch, caplog):
    where = free_endpoint()
    disk = threading.Event()
    with open_session(where) as first, open_session(where) as second, Stream(first, "bot/range", SCAN) as ranges:
        recorder = Recorder(second, "bot", tmp_path / "run.mcap", queue_bytes=50 * len(scan(0)))
        write = recorder._writer.write
        monkeypatch.setattr(recorder._writer, "write", lambda message: disk.wait(5) and write(message))
        time.sleep(0.1)
        for i in range(300):
            ranges.put(scan(i))
        until(lambda: sum(recorder.drops.values()) >= 249, "the drops")
        disk.set()
        recorder.close()
    assert recorder.messages + recorder.drops["range"] == 300
    assert recorder.messages in (50, 51)  # the queue, and the one in the writer's hands
    assert "dropped {'range': " in caplog.text


def test_a_disk_that_refuses_is_said_once_and_counted(tmp_path, monkeypatch, caplog):
    where = free_endpoint()

    def refuse(message):
        raise RecordingError("run.mcap: cannot be written: No space left on device")

    with open_session(where) as first, open_session(where) as second, Stream(first, "bot/range", SCAN) as ranges:
        with Recorder(second, "bot", tmp_path / "run.mcap") as recorder:
            monkeypatch.setattr(recorder._writer, "write", refuse)
            time.sleep(0.1)
            for i in range(20):
                ranges.put(scan(i))
            until(lambda: recorder.drops["range"] == 20, "the drops")
        assert "No space left" in str(recorder.error)
    assert caplog.text.count("No space left") == 1


def test_a_type_nobody_knows_is_left_out(tmp_path, caplog):
    where = free_endpoint()
    with (
        open_session(where) as first,
        open_session(where) as second,
        Stream(first, "bot/odd", "my_msgs/msg/Odd") as odd,
        Stream(first, "bot/range", SCAN) as ranges,
        Recorder(second, "bot", tmp_path / "run.mcap") as recorder,
    ):
        time.sleep(0.1)
        for i in range(5):
            odd.put(b"x")
            ranges.put(scan(i))
        until(lambda: recorder.messages == 5 and recorder.drops["odd"] == 5, "what can be recorded, and the drops")
    assert caplog.text.count("odd: cannot be recorded: 'my_msgs/msg/Odd'") == 1


def test_closing_takes_less_than_a_second(tmp_path):
    where = free_endpoint()
    with (
        open_session(where) as first,
        open_session(where) as second,
        Frames(first, "bot/camera", "sensor_msgs/msg/Image") as frames,
    ):
        recorder = Recorder(second, "bot", tmp_path / "run.mcap")
        time.sleep(0.1)
        pixels = np.random.default_rng(0).integers(0, 256, (120, 160, 3), np.uint8)
        picture = messages.encode(messages.image(1, pixels))
        for _ in range(200):
            frames.put(picture)
            time.sleep(0.001)
        before_s = time.monotonic()
        recorder.close()
        assert time.monotonic() - before_s < 1.0
    reader = read(tmp_path / "run.mcap")
    assert sum(1 for _ in reader) == recorder.messages
    assert reader.report.finished


def test_an_existing_file_is_refused_before_anything_starts(tmp_path):
    (tmp_path / "run.mcap").touch()
    with open_session(free_endpoint()) as session, pytest.raises(RecordingError, match="exists already"):
        Recorder(session, "bot", tmp_path / "run.mcap")
