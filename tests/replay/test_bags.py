import logging
import shutil
import sqlite3

import pytest
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter

from agents import messages
from agents.fields import read_field
from llrp_online.configuration.field import Field
from replay.recording import RecordingError, read
from tests.replay.bags import BOOL, RANGE, drive, write_ros1, write_ros2

DRIVE = drive()


@pytest.mark.parametrize(
    ("storage", "compression"),
    [
        ("mcap", "none"),
        ("mcap", "storage"),
        ("mcap", "message"),
        ("mcap", "file"),
        ("sqlite3", "none"),
        ("sqlite3", "message"),
        ("sqlite3", "file"),
    ],
)
def test_a_rosbag2_folder_is_read_whole(tmp_path, storage, compression):
    recording = read(write_ros2(tmp_path / "bag", DRIVE, storage, compression))
    assert list(recording) == DRIVE
    assert recording.report.finished
    assert recording.report.last_ns == DRIVE[-1].log_ns
    assert recording.report.messages == len(DRIVE)


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_bag_s_only_file_is_read_too(tmp_path, storage):
    [file] = [f for f in write_ros2(tmp_path / "bag", DRIVE, storage).iterdir() if f.suffix != ".yaml"]
    assert list(read(file)) == DRIVE


def test_a_ros_1_bag_is_read_as_the_same_messages(tmp_path):
    recording = read(write_ros1(tmp_path / "walk.bag", DRIVE))
    found = list(recording)
    assert [(m.topic, m.type, m.log_ns) for m in found] == [(m.topic, m.type, m.log_ns) for m in DRIVE]
    assert recording.report.last_ns == DRIVE[-1].log_ns
    for ours, theirs in zip(found, DRIVE, strict=True):
        if ours.type == RANGE:  # ROS 2 Iron gave it a field more
            assert read_field(messages.decode(RANGE, ours.data), Field.parse("range")) == pytest.approx(
                read_field(messages.decode(RANGE, theirs.data), Field.parse("range"))
            )
        else:
            assert ours.data == theirs.data
        assert messages.stamp_ns(ours.type, ours.data) == messages.stamp_ns(theirs.type, theirs.data)


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_killed_recorder_s_folder_has_no_metadata_and_is_read_as_far_as_it_is_whole(tmp_path, storage, caplog):
    folder = write_ros2(tmp_path / "bag", DRIVE, storage)
    (folder / "metadata.yaml").unlink()
    if storage == "mcap":
        [file] = folder.glob("*.mcap")
        file.write_bytes(file.read_bytes()[:-2000])
    recording = read(folder)
    found = list(recording)
    assert "no metadata.yaml: its recorder was stopped before it could finish" in caplog.text
    assert not recording.report.finished
    assert found == DRIVE[: len(found)]


def test_files_that_a_recorder_split_are_one_recording_in_order(tmp_path):
    folder = tmp_path / "bag"
    for part, messages_of_part in enumerate((DRIVE[1::2], DRIVE[::2])):
        made = write_ros2(tmp_path / f"part{part}", messages_of_part)
        folder.mkdir(exist_ok=True)
        shutil.copy(next(made.glob("*.mcap")), folder / f"bag_{part}.mcap")
    assert list(read(folder)) == DRIVE


def test_a_sqlite_recorder_that_was_killed_is_told_how_to_get_its_last_messages(tmp_path):
    folder = write_ros2(tmp_path / "bag", DRIVE, "sqlite3")
    [file] = folder.glob("*.db3")
    connection = sqlite3.connect(file)
    connection.execute("PRAGMA journal_mode=WAL")
    connection.execute("INSERT INTO messages (topic_id, timestamp, data) VALUES (1, 5, x'00')")
    connection.commit()
    for path in (folder, file):
        with pytest.raises(RecordingError, match=r"wal_checkpoint\(TRUNCATE\)"):
            read(path)
    connection.close()


def _truncated_sqlite(path):
    [file] = write_ros2(path / "bag", drive(600), "sqlite3").glob("*.db3")
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    return file


def _unindexed(path):
    file = write_ros1(path / "walk.bag", DRIVE)
    file.write_bytes(file.read_bytes()[:-400])
    return file


def _missing_file(path):
    folder = write_ros2(path / "bag", DRIVE, "sqlite3")
    next(folder.glob("*.db3")).unlink()
    return folder


def _bad_metadata(path):
    folder = write_ros2(path / "bag", DRIVE)
    (folder / "metadata.yaml").write_text("a: [")
    return folder


def _no_bag(path):
    (path / "photos").mkdir()
    (path / "photos" / "a.jpg").touch()
    return path / "photos"


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (_truncated_sqlite, "if its recorder was killed, mend it with `ros2 bag reindex`"),
        (_unindexed, "if its recorder was killed, mend it with `rosbag reindex`"),
        (_missing_file, "Some database files are missing"),
        (_bad_metadata, "metadata.yaml: cannot be understood"),
        (_no_bag, "the folder has a.jpg; expected an MCAP file, a rosbag2 folder or its .db3 file"),
    ],
)
def test_what_cannot_be_read_is_refused_with_a_reason(tmp_path, make, says):
    path = make(tmp_path)
    with pytest.raises(RecordingError) as caught:
        list(read(path))
    assert says in str(caught.value)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("chunked", [True, False])
@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD])
def test_an_mcap_of_another_tool_is_read_and_what_is_not_cdr_left_out(tmp_path, chunked, compression, caplog):
    path = tmp_path / "other.mcap"
    writer = McapWriter(str(path), use_chunking=chunked, compression=compression)
    writer.start(profile="", library="another tool")
    schema = writer.register_schema(BOOL, "ros2idl", b"module std_msgs {};")
    cdr = writer.register_channel("/bump", "cdr", schema)
    json = writer.register_channel("/note", "json", writer.register_schema("note", "jsonschema", b"{}"))
    for i in range(5):
        writer.add_message(cdr, i, bytes([0, 1, 0, 0, i % 2]), i)
        writer.add_message(json, i, b"{}", i)
    writer.finish()
    with caplog.at_level(logging.WARNING):
        found = list(read(path))
    assert [(m.topic, m.type, m.data[4]) for m in found] == [("/bump", BOOL, i % 2) for i in range(5)]
    assert "/note: left out: expected cdr, got 'json'" in caplog.text
