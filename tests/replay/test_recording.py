import contextlib
import itertools
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import Writer as McapWriter

from replay.recording import Message, Reader, RecordingError, Writer, read

DATA = Path(__file__).parents[2].parent / "shared" / "data"
needs_data = pytest.mark.skipif(not DATA.exists(), reason=f"the real recordings are not at {DATA}")
TYPE = "std_msgs/msg/String"


def define(type_name: str) -> str:
    return f"# {type_name}\nstring data\n"


def write(path: Path, messages: list[Message]) -> None:
    with Writer(path, define) as writer:
        for message in messages:
            writer.write(message)


def numbered(count: int, size: int = 400) -> list[Message]:
    """Incompressible, so that they fill chunks."""
    return [Message(f"/t{i % 3}", TYPE, i, i.to_bytes(4, "little") + os.urandom(size)) for i in range(count)]


messages_strategy = st.lists(
    st.builds(
        Message,
        topic=st.sampled_from(["/odom", "range", "/a/b"]),
        type=st.sampled_from([TYPE, "sensor_msgs/msg/Range"]),
        log_ns=st.integers(0, 2**64 - 1),
        data=st.binary(max_size=60),
    ),
    max_size=30,
)


@given(messages=messages_strategy)
@settings(max_examples=50, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_what_is_written_is_read_in_log_time_order(messages, tmp_path):
    path = tmp_path / "run.mcap"
    path.unlink(missing_ok=True)
    write(path, messages)
    reader = read(path)
    assert list(reader) == sorted(messages, key=lambda message: message.log_ns)
    assert reader.report.finished
    assert reader.report.lost_bytes == 0
    assert reader.report.messages == len(messages)


def test_order_holds_across_many_chunks_and_a_clock_set_back(tmp_path):
    messages = [m._replace(log_ns=(i * 7919) % 2000) for i, m in enumerate(numbered(2000))]
    write(tmp_path / "run.mcap", messages)
    assert list(read(tmp_path / "run.mcap")) == sorted(messages, key=lambda m: m.log_ns)


def test_the_file_says_what_it_is(tmp_path):
    write(tmp_path / "run.mcap", numbered(500))
    with (tmp_path / "run.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert reader.get_header().profile == "ros2"
    assert summary is not None
    assert {(s.name, s.encoding, s.data.decode()) for s in summary.schemas.values()} == {
        (TYPE, "ros2msg", define(TYPE))
    }
    assert {channel.message_encoding for channel in summary.channels.values()} == {"cdr"}
    assert {chunk.compression for chunk in summary.chunk_indexes} == {"zstd"}
    assert max(chunk.uncompressed_size for chunk in summary.chunk_indexes) < 66_000


def test_memory_stays_that_of_a_few_chunks(tmp_path):
    path = tmp_path / "run.mcap"
    with Writer(path, define) as writer:
        for i in range(400):
            writer.write(Message("/camera", TYPE, i, os.urandom(100_000)))
    code = (
        "import resource, sys; from replay.recording import read; reader = read(sys.argv[1]); next(reader);"
        "before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss; n = 1 + sum(1 for _ in reader);"
        "print(n, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)"
    )
    count, grown_kb = map(int, subprocess.check_output([sys.executable, "-c", code, str(path)], text=True).split())
    assert count == 400
    assert grown_kb < 8_000  # the file has 40 MB


@needs_data
def test_real_recordings_are_read_whole():
    reader = read(DATA / "drone" / "A0.mcap")
    messages = list(reader)
    assert len(messages) == 97 + 206 + 217
    assert {(m.topic, m.type) for m in messages} >= {("/odom", "nav_msgs/msg/Odometry")}
    assert all(a.log_ns <= b.log_ns for a, b in itertools.pairwise(messages))


def rewritten(folder: Path) -> tuple[list[Message], bytes]:
    """A real recording in chunks of our size, as our own recorder leaves it."""
    messages = list(read(DATA / "drone" / "A0.mcap"))
    write(folder / "whole.mcap", messages)
    return messages, (folder / "whole.mcap").read_bytes()


@needs_data
def test_a_file_cut_anywhere_gives_a_prefix_and_a_warning(tmp_path, caplog):
    messages, whole = rewritten(tmp_path)
    cut_path, lengths = tmp_path / "cut.mcap", []
    for size in [*range(8, 200, 7), *range(200, len(whole) - 1, 2503), *range(len(whole) - 300, len(whole), 7)]:
        cut_path.write_bytes(whole[:size])
        caplog.clear()
        reader = read(cut_path)
        found = list(reader)
        assert found == messages[: len(found)]
        assert not reader.report.finished
        assert reader.report.whole_bytes + reader.report.lost_bytes == size
        assert reader.report.lost_bytes < 66_000  # less than a chunk
        assert f"the last {reader.report.lost_bytes} bytes are lost" in caplog.text
        lengths.append(len(found))
    assert lengths == sorted(lengths)
    assert lengths[-1] == len(messages)  # of the index alone nothing is missing


@needs_data
def test_a_real_file_with_large_chunks_cut_anywhere_gives_a_prefix(tmp_path, caplog):
    path = DATA / "nao" / "2013062101.mcap"
    messages, whole = list(read(path)), path.read_bytes()
    for size in range(8, len(whole), len(whole) // 40):
        (tmp_path / "cut.mcap").write_bytes(whole[:size])
        found = list(read(tmp_path / "cut.mcap"))
        assert found == messages[: len(found)]
    assert len(found) > 200


def test_a_tail_of_zeros_after_a_power_cut_is_lost_and_the_rest_read(tmp_path, caplog):
    messages = numbered(2000)
    write(tmp_path / "run.mcap", messages)
    whole = (tmp_path / "run.mcap").read_bytes()
    half = len(whole) // 2
    (tmp_path / "run.mcap").write_bytes(whole[:half] + bytes(len(whole) - half))
    found = list(read(tmp_path / "run.mcap"))
    assert found == messages[: len(found)]
    assert 800 < len(found) < 1000
    assert "unfinished" in caplog.text


WRITER = """
import sys, os, itertools
from replay.recording import Message, Writer
with Writer(sys.argv[1], lambda type_name: "string data") as writer:
    for i in itertools.count():
        writer.write(Message("/t", "std_msgs/msg/String", i, i.to_bytes(4, "little") + os.urandom(200)))
        if i == 1000:
            print("going", flush=True)
"""


def signalled(path: Path, number: signal.Signals, after_s: float) -> int:
    process = subprocess.Popen(
        [sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    with process:
        assert process.stdout is not None
        assert process.stdout.readline() == "going\n"
        time.sleep(after_s)
        process.send_signal(number)
        return process.wait(10)


def test_a_killed_writer_leaves_a_prefix(tmp_path, caplog):
    for run, after_s in enumerate((0.0, 0.05)):
        path = tmp_path / f"{run}.mcap"
        assert signalled(path, signal.SIGKILL, after_s) == -signal.SIGKILL
        found = [message.log_ns for message in read(path)]
        assert len(found) > 600
        assert found == list(range(len(found)))
        assert "unfinished" in caplog.text


def test_ctrl_c_leaves_a_finished_file(tmp_path):
    for run in range(6):
        path = tmp_path / f"{run}.mcap"
        assert signalled(path, signal.SIGINT, 0.013 * run) in (1, -signal.SIGINT)
        reader = read(path)
        found = [message.log_ns for message in reader]
        assert reader.report.finished
        assert found == list(range(len(found)))


@needs_data
@given(where=st.floats(0.01, 0.99), byte=st.integers(0, 255), length=st.sampled_from([1, 40]))
@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_damage_is_found_or_does_not_matter(where, byte, length, tmp_path_factory):
    folder = tmp_path_factory.mktemp("damage")
    messages, whole = rewritten(folder)
    at = int(where * len(whole))
    (folder / "bad.mcap").write_bytes(whole[:at] + bytes([byte]) * length + whole[at + length :])
    found: list[Message] = []
    with contextlib.suppress(RecordingError):
        found.extend(iter(read(folder / "bad.mcap")))
    # Chunk times are outside the check sum; what is read must be true all the same.
    assert set(found) <= set(messages)


def test_a_damaged_chunk_is_named_after_the_messages_before_it(tmp_path):
    messages = numbered(1000)
    write(tmp_path / "run.mcap", messages)
    content = bytearray((tmp_path / "run.mcap").read_bytes())
    content[len(content) // 2] ^= 0xFF
    (tmp_path / "run.mcap").write_bytes(content)
    found: list[Message] = []
    with pytest.raises(RecordingError, match=r"run.mcap: damaged: the chunk at byte \d+ cannot be read"):
        found.extend(iter(read(tmp_path / "run.mcap")))
    assert next(read(tmp_path / "run.mcap")) == messages[0]


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (None, "cannot be read: No such file"),
        (b"", "empty"),
        (b"SQLite format 3\0", "a SQLite file by its first bytes; if it is a rosbag2 file, call it .db3"),
        (b"PNG", "not a recording: it begins with b'PNG'; expected an MCAP file, a rosbag2 folder"),
        (b"\x89MC", "not an MCAP file"),
    ],
)
def test_what_is_no_recording_says_so(content, says, tmp_path):
    path = tmp_path / "run.mcap"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(RecordingError, match=says) as caught:
        read(path)
    assert str(path) in str(caught.value)


def test_other_encodings_are_left_out_with_a_warning(tmp_path, caplog):
    with (tmp_path / "run.mcap").open("wb") as file:
        writer = McapWriter(file, use_chunking=False)
        writer.start()
        schema = writer.register_schema(TYPE, "ros2msg", b"string data")
        json, cdr = (writer.register_channel(f"/{name}", name, schema) for name in ("json", "cdr"))
        for t_ns in (2, 1):  # outside any chunk, too
            writer.add_message(json, t_ns, b"{}", t_ns)
            writer.add_message(cdr, t_ns, b"\0\1\0\0", t_ns)
        writer.finish()
    assert [(m.topic, m.log_ns) for m in read(tmp_path / "run.mcap")] == [("/cdr", 1), ("/cdr", 2)]
    assert caplog.text.count("/json: left out: expected cdr, got 'json'") == 1


def test_a_recording_is_never_overwritten(tmp_path):
    write(tmp_path / "run.mcap", [])
    with pytest.raises(RecordingError, match="exists already"):
        Writer(tmp_path / "run.mcap", define)
    with pytest.raises(RecordingError, match="cannot be written: No such file"):
        Writer(tmp_path / "nowhere" / "run.mcap", define)


def test_what_cannot_be_written_leaves_the_rest_in_order(tmp_path):
    with Writer(tmp_path / "run.mcap", {TYPE: define(TYPE)}.__getitem__) as writer:
        writer.write(Message("/a", TYPE, 1, b"1"))
        with pytest.raises(KeyError):
            writer.write(Message("/b", "no_such/msg/Type", 2, b"2"))
        with pytest.raises(RecordingError, match="log time -1 ns"):
            writer.write(Message("/a", TYPE, -1, b"3"))
        writer.write(Message("/a", TYPE, 4, b"4"))
    with pytest.raises(RecordingError, match="closed"):
        writer.write(Message("/a", TYPE, 5, b"5"))
    writer.close()
    assert [message.data for message in read(tmp_path / "run.mcap")] == [b"1", b"4"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")
def test_a_full_disk_is_a_recording_error(tmp_path, monkeypatch):
    monkeypatch.setattr(Path, "open", lambda path, mode: open("/dev/full", "wb"))  # noqa: PTH123, SIM115
    with pytest.raises(RecordingError, match="No space left"):
        Writer(tmp_path / "run.mcap", define)


def test_a_reader_is_an_iterator(tmp_path):
    write(tmp_path / "run.mcap", [])
    reader = read(tmp_path / "run.mcap")
    assert isinstance(reader, Reader)
    assert isinstance(reader, Iterator)
    assert list(reader) == []
