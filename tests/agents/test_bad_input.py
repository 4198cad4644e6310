"""Bad input through the commands: each time a message that says what is wrong, never a traceback or a wrong answer."""

import json
import math
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from agents import messages
from agents.cli import main
from agents.robots.wire import ODOMETRY_TYPE, PICTURE_TYPE, RANGE_TYPE
from llrp_online.events import OdometrySample
from replay.recording import Message, Writer
from tests.agents.processes import ROOT, quick_configuration

SECONDS, RATE_HZ = 20, 10
START_NS = 10**12


def drive(size: tuple[int, int] = (80, 64), seconds: int = SECONDS) -> Iterator[Message]:
    """A robot that drives straight on at 10 Hz; its right sensor feels something for a tenth of each metre."""
    random = np.random.default_rng(0)
    width, height = size
    for tick in range(seconds * RATE_HZ):
        t_ns = START_NS + tick * 10**9 // RATE_HZ
        x_m = 0.1 * tick / RATE_HZ
        ranges = [0.05 if x_m % 0.5 < 0.1 else math.inf, *[math.inf] * 4]
        parts = (
            ("odom", ODOMETRY_TYPE, messages.odometry(OdometrySample(t_ns, np.array([x_m, 0.0, 0.0])), (0.1, 0.0))),
            ("range", RANGE_TYPE, messages.laser_scan(t_ns, ranges, (-0.7, 0.7), (0.0, 0.1))),
            (
                "camera/image/compressed",
                PICTURE_TYPE,
                messages.compressed_image(t_ns, random.integers(0, 255, (height, width, 3), np.uint8)),
            ),
        )
        for topic, type_name, message in parts:
            yield Message(f"/thymio/{topic}", type_name, t_ns, messages.encode(message))


def record(path: Path, stream: Iterator[Message]) -> Path:
    with Writer(path, messages.definition) as writer:
        for message in stream:
            writer.write(message)
    return path


def changed(topic: str, change: Callable[[int, object], object]) -> Iterator[Message]:
    """The drive, with the messages of a topic changed: `change(count, message)` gives another, or bytes, or None."""
    count = 0
    for message in drive():
        if not message.topic.endswith(topic):
            yield message
            continue
        other = change(count, messages.decode(message.type, message.data))
        count += 1
        if other is not None:
            yield message._replace(data=other if isinstance(other, bytes) else messages.encode(other))


class Said:
    """What a command said."""

    def __init__(self, code: int, out: str, err: str) -> None:
        self.code, self.out, self.err = code, out, err


@pytest.fixture
def llrp(capsys, caplog):
    def run(*words: object) -> Said:
        capsys.readouterr()
        caplog.clear()
        code = main([str(word) for word in words])
        out, err = capsys.readouterr()
        # Warnings go to standard error by a handler of `main`; under pytest its own takes them. Once on a machine the
        # compiler has its say, which is not the command's.
        records = (record for record in caplog.records if record.name != "replay.compiling")
        said = Said(code, out, err + "".join(record.getMessage() + "\n" for record in records))
        assert "Traceback" not in said.err
        assert "Traceback" not in said.out
        return said

    return run


@pytest.fixture(scope="module")
def config(tmp_path_factory) -> Path:
    return quick_configuration(tmp_path_factory.mktemp("config"))


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    return record(tmp_path_factory.mktemp("drive") / "whole.mcap", drive())


def label(llrp, recording: Path, config: Path, folder: Path) -> Said:
    return llrp("label", recording, "--config", config, "--output", folder / "labels.npz", "--json")


def learn(llrp, recording: Path, config: Path, folder: Path) -> Said:
    return llrp("learn", "--recordings", recording, "--config", config, "--output", folder / "run", "--json")


def test_the_whole_drive_is_labelled_and_learned_from_in_silence(llrp, whole, config, tmp_path):
    for run in (label, learn):
        said = run(llrp, whole, config, tmp_path)
        assert (said.code, said.err) == (0, "")
        found = json.loads(said.out)
        assert found["known_labels"] > 1000
        assert found["positive_labels"] > 50


@pytest.mark.parametrize("run", [label, learn])
def test_a_truncated_recording_is_read_as_far_as_it_is_whole(llrp, whole, config, tmp_path, run):
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole.read_bytes()[: whole.stat().st_size * 2 // 3])
    said = run(llrp, cut, config, tmp_path)
    assert said.code == 0
    assert f"{cut}: unfinished, its writer was stopped before it could close it: " in said.err
    assert "bytes are whole (messages up to 10" in said.err
    assert "bytes are lost" in said.err
    assert 0 < json.loads(said.out)["frames"] < SECONDS * RATE_HZ


@pytest.mark.parametrize("run", [label, learn])
def test_a_damaged_recording_is_named_with_the_place(llrp, whole, config, tmp_path, run):
    damaged = bytearray(whole.read_bytes())
    middle = len(damaged) // 2
    damaged[middle : middle + 100] = bytes(100)
    path = tmp_path / "damaged.mcap"
    path.write_bytes(damaged)
    said = run(llrp, path, config, tmp_path)
    assert (said.code, said.out) == (1, "")
    assert f"llrp {'label' if run is label else 'learn'}: {path}: damaged: the chunk at byte " in said.err
    assert "copy the file again from where it was recorded" in said.err


@pytest.mark.parametrize("run", [label, learn])
@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"", "empty: its writer was killed before the first chunk, or a copy failed"),
        (b"SQLite format 3\0" * 99, "a SQLite file by its first bytes; if it is a rosbag2 file, call it .db3"),
        (b"PNG or so" * 99, "not a recording: it begins with b'PNG or s'; expected an MCAP file, a rosbag2 folder"),
    ],
)
def test_a_file_that_is_no_recording_is_named(llrp, config, tmp_path, run, content, expected):
    path = tmp_path / "walk.mcap"
    path.write_bytes(content)
    said = run(llrp, path, config, tmp_path)
    assert (said.code, said.out) == (1, "")
    assert f"{path}: {expected}" in said.err


@pytest.mark.parametrize("run", [label, learn])
@pytest.mark.parametrize("topic", ["odom", "range", "camera/image/compressed"])
def test_a_missing_topic_is_named_beside_those_that_came(llrp, config, tmp_path, run, topic):
    path = record(tmp_path / "lacks.mcap", (m for m in drive() if not m.topic.endswith(topic)))
    said = run(llrp, path, config, tmp_path)
    assert (said.code, said.out) == (1, "")
    assert f"{path}: no message on: {topic}; what came: /thymio/" in said.err
    assert "Make the topics in the configuration agree" in said.err


@pytest.mark.parametrize("run", [label, learn])
def test_swapped_width_and_height_are_noticed_and_the_mend_is_said(llrp, tmp_path, run):
    (tmp_path / "swapped").mkdir()
    swapped = quick_configuration(tmp_path / "swapped", **{"width = 20": "width = 16", "height = 16": "height = 20"})
    turned = record(tmp_path / "tall.mcap", drive((64, 80)))
    upright = quick_configuration(tmp_path)
    for said in (
        run(llrp, record(tmp_path / "wide.mcap", drive((128, 80))), swapped, tmp_path / "a"),
        run(llrp, turned, upright, tmp_path / "b"),
    ):
        assert said.code == 0
        assert "width and height look swapped; swap them in the configuration, or turn the camera's picture" in said.err


@pytest.mark.parametrize("run", [label, learn])
def test_odometry_that_is_no_number_is_counted_and_never_used(llrp, config, tmp_path, run):
    def poison(count: int, message):
        if count % 3 == 1:
            message.pose.pose.position.x = math.nan
        return message

    said = run(llrp, record(tmp_path / "nan.mcap", changed("odom", poison)), config, tmp_path)
    assert said.code == 0
    assert "odom: a pose that is not finite (NaN or infinite) (1 so far)" in said.err
    count = len(range(1, SECONDS * RATE_HZ, 3))
    assert f"dropped {count}: odom: a pose that is not finite" in said.err
    assert json.loads(said.out)["known_labels"] > 500


@pytest.mark.parametrize("run", [label, learn])
def test_nothing_but_bad_odometry_gives_no_label_and_says_why(llrp, config, tmp_path, run):
    def poison(_: int, message):
        message.pose.pose.position.y = math.inf
        return message

    said = run(llrp, record(tmp_path / "inf.mcap", changed("odom", poison)), config, tmp_path)
    assert said.code == 0
    assert json.loads(said.out)["known_labels"] == 0
    assert f"dropped {SECONDS * RATE_HZ}: odom: a pose that is not finite" in said.err
    assert "no label became known" in said.err


@pytest.mark.parametrize("run", [label, learn])
def test_pictures_of_garbage_are_counted_and_left_out(llrp, config, tmp_path, run):
    def spoil(count: int, message):
        if count % 2:
            message.data = np.frombuffer(b"\xff\xd8 this is no picture \xff\xd9", np.uint8)
        return message

    path = record(tmp_path / "garbage.mcap", changed("compressed", spoil))
    said = run(llrp, path, config, tmp_path)
    assert said.code == 0
    assert "camera/image/compressed: not a decodable picture" in said.err
    assert f"dropped {SECONDS * RATE_HZ // 2}: camera/image/compressed: not a decodable picture" in said.err
    found = json.loads(said.out)
    assert found["frames"] == SECONDS * RATE_HZ // 2
    assert found["known_labels"] > 500


@pytest.mark.parametrize("run", [label, learn])
def test_a_clock_that_jumps_back_ends_the_trajectory(llrp, config, tmp_path, run):
    """All stamps of the second half are a quarter of an hour earlier; log times run on."""

    def jumping() -> Iterator[Message]:
        for message in drive():
            if message.log_ns >= START_NS + SECONDS // 2 * 10**9:
                decoded = messages.decode(message.type, message.data)
                decoded.header.stamp.sec -= 900
                message = message._replace(data=messages.encode(decoded))
            yield message

    said = run(llrp, record(tmp_path / "jump.mcap", jumping()), config, tmp_path)
    assert said.code == 0
    assert "the odometry clock jumped back by 899.500 s: the trajectory ends here" in said.err
    assert "look for two publishers on the odometry topic or a clock that is being set" in said.err
    found = json.loads(said.out)
    assert found["known_labels"] > 500


@pytest.mark.parametrize("run", [label, learn])
def test_a_misspelt_key_is_named_with_the_nearest_known_one(llrp, whole, tmp_path, run):
    bad = quick_configuration(tmp_path, position_tolerance_m="position_tolerence_m")
    said = run(llrp, whole, bad, tmp_path)
    assert (said.code, said.out) == (1, "")
    assert f"{bad}: cannot be used" in said.err
    assert (
        "labels.position_tolerence_m: unknown key (its value: 0.01); did you mean `position_tolerance_m`?" in said.err
    )


def test_a_recording_without_a_label_teaches_nothing_and_that_is_said(llrp, config, tmp_path):
    """A robot that stands still where no target is."""
    text = config.read_text().replace("start_m = 0.0", "start_m = 50.0").replace("stop_m = 0.30", "stop_m = 50.3")
    far = tmp_path / "far.toml"
    far.write_text(text)
    path = record(tmp_path / "short.mcap", drive(seconds=3))
    said = learn(llrp, path, far, tmp_path)
    assert said.code == 0
    assert "no label became known, so nothing was learned: see `llrp check` for the likely cause" in said.err
    found = json.loads(said.out)
    assert (found["known_labels"], found["steps"]) == (0, 0)
    checkpoint = tmp_path / "run" / "checkpoint"
    said = llrp("evaluate", checkpoint, path, "--config", far, "--json")
    assert said.code == 0, said.err
    assert json.loads(said.out)["pooled_auc"] is None
    assert "no label became known, so every score is blank: see `llrp check` for the likely cause" in said.err
    said = llrp("train", path, "--config", far, "--output", tmp_path / "trained")
    assert (said.code, said.out) == (1, "")
    assert "no labelled frame to train on: see `llrp check RECORDING` for the cause" in said.err


def test_a_checkpoint_of_another_robot_is_refused(llrp, whole, config, tmp_path):
    assert learn(llrp, whole, config, tmp_path).code == 0
    kept = tmp_path / "run" / "checkpoint"
    drone = ROOT / "configs" / "drone.toml"
    for option in ("--warm-start", "--resume"):
        words = ("learn", "--recordings", whole, "--config", drone, "--output", tmp_path / "other", option, kept)
        said = llrp(*words)
        assert (said.code, said.out) == (1, "")
        assert f"{kept}: its labels are of other targets or sensors than the configuration's" in said.err
        assert "give the configuration it was trained with" in said.err


def test_a_checkpoint_of_a_like_robot_with_other_targets_is_not_evaluated(llrp, whole, config, tmp_path):
    """The network would fit, and every score would be of another place than it says."""
    assert learn(llrp, whole, config, tmp_path).code == 0
    shifted = tmp_path / "shifted.toml"
    shifted.write_text(config.read_text().replace("start_m = 0.0", "start_m = 0.1").replace("= 0.30", "= 0.40"))
    said = llrp("evaluate", tmp_path / "run" / "checkpoint", whole, "--config", shifted)
    assert (said.code, said.out) == (1, "")
    assert "its labels are of other targets or sensors than the configuration's" in said.err


@pytest.mark.parametrize(
    "words",
    [
        ("label", "{whole}", "--output", "{file}/labels.npz"),
        ("train", "{whole}", "--steps", "1", "--output", "{file}/checkpoint"),
        ("learn", "--recordings", "{whole}", "--output", "{file}/run"),
        ("record", "--simulate", "--minutes", "0.01", "--output", "{file}/run.mcap"),
    ],
    ids=lambda words: words[0],
)
def test_an_output_that_cannot_be_written_is_named_before_the_work(llrp, whole, config, tmp_path, monkeypatch, words):
    monkeypatch.setattr("agents.commands.label.labels_of", lambda *_: pytest.fail("it has begun"))
    monkeypatch.setattr("agents.commands.train.labelled_frames", lambda *_: pytest.fail("it has begun"))
    monkeypatch.setattr("agents.commands.learn.learn_over", lambda *_: pytest.fail("it has begun"))
    file = tmp_path / "a_file"
    file.write_text("no folder")
    said = llrp(*(word.format(whole=whole, file=file) for word in words), "--config", config)
    assert (said.code, said.out) == (1, "")
    assert said.err.startswith(f"llrp {words[0]}: {file}")
    assert ": cannot be made a folder to write in: " in said.err
    assert file.read_text() == "no folder"


def test_what_is_no_checkpoint_is_never_replaced(llrp, whole, config, tmp_path):
    precious = tmp_path / "run" / "checkpoint"
    precious.mkdir(parents=True)
    (precious / "thesis.txt").write_text("years of work")
    for words in (
        ("train", whole, "--steps", "1", "--output", precious),
        ("learn", "--recordings", whole, "--output", tmp_path / "run"),
    ):
        said = llrp(*words, "--config", config)
        assert (said.code, said.out) == (1, "")
        assert (
            f"{precious}: exists and is no checkpoint (no manifest.json); not replaced: give another path" in said.err
        )
    assert (precious / "thesis.txt").read_text() == "years of work"


def test_a_recording_is_never_overwritten(llrp, whole, config):
    before = whole.read_bytes()
    said = llrp("record", "--simulate", "--minutes", "0.01", "--config", config, "--output", whole)
    assert (said.code, said.out) == (1, "")
    assert f"{whole}: exists already, and a recording is never overwritten; remove it or name another file" in said.err
    assert whole.read_bytes() == before


def test_a_run_is_never_overwritten_by_a_demo(llrp, tmp_path):
    (tmp_path / "run.mcap").write_bytes(b"yesterday")
    said = llrp("demo", "--output", tmp_path)
    assert (said.code, said.out) == (1, "")
    assert (
        f"{tmp_path}: holds a run already, which is never overwritten; remove it or give another --output" in said.err
    )
    assert (tmp_path / "run.mcap").read_bytes() == b"yesterday"


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--scenario", "moon"), "configs/scenarios/moon.toml: cannot be read: No such file or directory"),
        (("--config", "configs/drone.toml"), "robot 'drone': its configuration has no [simulation] table; add one"),
    ],
)
def test_a_world_that_is_not_there_is_named(llrp, tmp_path, words, expected):
    said = llrp("record", "--simulate", "--minutes", "0.01", "--output", tmp_path / "r.mcap", *words)
    assert (said.code, said.out) == (1, "")
    assert expected in said.err
    assert not (tmp_path / "r.mcap").exists()
