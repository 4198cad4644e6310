"""`label`, `train`, `evaluate` and `learn` over a real drone flight, end to end and in few steps."""

import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from agents import messages
from agents.cli import main
from llrp_online import checkpoint
from replay.compiling import Compiled
from replay.recording import Writer, read

ROOT = Path(__file__).parents[2]
DRONE = ROOT.parent / "shared" / "data" / "drone"
FLIGHT, OTHER_FLIGHT = DRONE / "O23.mcap", DRONE / "A9.mcap"  # the shortest two
CONFIG = ROOT / "configs" / "drone.toml"
SCORE = {"targets", "sensors", "auc", "low", "high", "n_pos", "n_neg", "pooled_auc"}
needs_data = pytest.mark.skipif(not DRONE.exists(), reason=f"the real recordings are not at {DRONE}")


def llrp(*words) -> int:
    return main([str(word) for word in words])


@pytest.fixture
def answer(capsys):
    """Runs a command that must succeed; the one JSON object it prints."""

    def run(*words):
        capsys.readouterr()
        code = llrp(*words, "--json")
        out, err = capsys.readouterr()
        assert code == 0, err
        return json.loads(out, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))

    return run


@pytest.fixture
def refusal(capsys):
    """Runs a command that must fail with code 1; what it says on standard error."""

    def run(*words):
        capsys.readouterr()
        code = llrp(*words)
        out, err = capsys.readouterr()
        assert (code, out) == (1, "")
        assert err.startswith(f"llrp {words[0]}: ")
        assert "Traceback" not in err
        return err

    return run


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """The drone's configuration with small pictures and batches."""
    text = CONFIG.read_text().replace("width = 80", "width = 20").replace("height = 64", "height = 16")
    path = tmp_path_factory.mktemp("config") / "drone.toml"
    path.write_text(text + "\n[training]\nbatch = 8\nwarmup_frames = 8\n[publishing]\nevery_s = 1.0\n")
    return path


@pytest.fixture(scope="module")
def trained(small, tmp_path_factory):
    path = tmp_path_factory.mktemp("trained") / "deep" / "checkpoint"
    assert llrp("train", FLIGHT, "--config", small, "--output", path, "--steps", 5) == 0
    return path


def is_score(found, targets=11, sensors=4):
    assert set(found) == SCORE
    assert found["sensors"] == ["left", "center_left", "center_right", "right"]
    np.testing.assert_allclose(np.array(found["targets"]), [[0.2 * i, 0, 0] for i in range(targets)], atol=1e-9)
    for key in ("auc", "low", "high", "n_pos", "n_neg"):
        assert np.array(found[key], dtype=object).shape == (targets, sensors), key
    for row in zip(*(np.array(found[key], dtype=object).ravel() for key in ("auc", "n_pos", "n_neg")), strict=True):
        auc, n_pos, n_neg = row
        assert isinstance(n_pos, int)
        assert isinstance(n_neg, int)
        assert (auc is None) == (n_pos == 0 or n_neg == 0)
        assert auc is None or 0 <= auc <= 1
    assert found["pooled_auc"] is None or 0 <= found["pooled_auc"] <= 1


@needs_data
def test_label_writes_one_row_a_frame_with_a_pose(answer, tmp_path):
    out = tmp_path / "labels.npz"
    said = answer("label", FLIGHT, "--config", CONFIG, "--output", out)
    with np.load(out, allow_pickle=False) as arrays:
        assert set(arrays) == {"t", "labels", "weight"}
        t, labels, weight = arrays["t"], arrays["labels"], arrays["weight"]
    frames = said["frames"]
    assert frames > 30
    assert (t.shape, labels.shape, weight.shape) == ((frames,), (frames, 11, 4), (frames, 11, 4))
    assert (t.dtype, labels.dtype, weight.dtype) == (np.float64, np.int8, np.float32)
    assert set(np.unique(labels)) == {-1, 0, 1}
    assert (np.diff(t) > 0).all()
    messages = [message for message in read(FLIGHT) if message.topic.endswith("image/compressed")]
    assert frames <= len(messages)
    assert messages[0].log_ns * 1e-9 - 1 < t[0] < t[-1] < messages[-1].log_ns * 1e-9 + 1
    # With a fixed window a label is trusted wholly, or it is unknown.
    np.testing.assert_array_equal(weight, (labels >= 0).astype(np.float32))
    assert said == {
        "frames": frames,
        "known_labels": int((labels >= 0).sum()),
        "positive_labels": int((labels == 1).sum()),
    }


@needs_data
def test_label_tells_people_what_is_known(capsys, tmp_path):
    assert llrp("label", FLIGHT, "--config", CONFIG, "--output", tmp_path / "labels.npz") == 0
    lines = capsys.readouterr().out.splitlines()
    assert "known labels" in lines[0]
    assert len(lines) == 1 + 11


@needs_data
def test_train_says_what_it_did_and_saves_it(answer, small, tmp_path):
    first = answer("train", FLIGHT, OTHER_FLIGHT, "--config", small, "--output", tmp_path / "c", "--steps", 3)
    assert set(first) >= {"frames", "known_labels", "steps", "weights_sha256"}
    assert first["steps"] == 3
    assert math.isfinite(first["loss"])
    assert first["known_labels"] > first["frames"] > 60
    tensors, manifest = checkpoint.load(tmp_path / "c")
    assert set(tensors) >= {"weights", "memory"}
    assert len(tensors["memory"]["ids"]) == first["frames"]
    assert manifest["configuration"]["robot"]["name"] == "drone"
    again = answer("train", FLIGHT, OTHER_FLIGHT, "--config", small, "--output", tmp_path / "c", "--steps", 3)
    assert again == first


@needs_data
def test_train_for_no_steps_is_json_too(answer, small, tmp_path):
    said = answer("train", FLIGHT, "--config", small, "--output", tmp_path / "c", "--steps", 0)
    assert (said["steps"], said["loss"]) == (0, None)


@needs_data
def test_evaluate_prints_a_score(answer, small, trained):
    found = answer("evaluate", trained, FLIGHT, OTHER_FLIGHT, "--config", small, "--rounds", 20)
    is_score(found)
    for target, row in enumerate(found["auc"]):
        for sensor, auc in enumerate(row):
            low, high = found["low"][target][sensor], found["high"][target][sensor]
            assert (auc is None) == (low is None) == (high is None)
            assert auc is None or low <= high
    alone = answer("evaluate", trained, FLIGHT, "--config", small, "--rounds", 0)
    is_score(alone)
    assert np.sum(alone["n_neg"]) < np.sum(found["n_neg"])
    assert all(value is None for row in alone["low"] for value in row)


@needs_data
def test_evaluate_tells_people_too(capsys, small, trained):
    assert llrp("evaluate", trained, FLIGHT, "--config", small, "--rounds", 2) == 0
    out = capsys.readouterr().out
    assert "center_left" in out
    assert "all known labels together" in out


@needs_data
def test_learn_twice_gives_the_same_weights(answer, small, tmp_path):
    runs = []
    for number in range(2):
        output = tmp_path / f"run{number}"
        runs.append(answer("learn", "--recordings", FLIGHT, OTHER_FLIGHT, "--config", small, "--output", output))
        assert checkpoint.load(output / "checkpoint")[1]["version"] >= 1
    assert runs[0] == runs[1]
    first = runs[0]
    assert set(first) >= {"frames", "known_labels", "steps", "weights_sha256", "prequential"}
    assert len(first["weights_sha256"]) == 64
    assert first["steps"] > 20
    assert first["frames"] > 100
    is_score(first["prequential"])
    assert 0 < np.sum(first["prequential"]["n_neg"]) < first["known_labels"]
    other = answer(
        "learn", "--recordings", FLIGHT, OTHER_FLIGHT, "--config", small, "--output", tmp_path / "run2", "--seed", 1
    )
    assert other["weights_sha256"] != first["weights_sha256"]
    assert other["seed"] == 1


@needs_data
def test_learn_goes_on_from_what_train_and_learn_saved(answer, refusal, small, trained, tmp_path):
    learn = ("learn", "--recordings", OTHER_FLIGHT, "--config", small, "--output", tmp_path / "run")
    cold = answer(*learn)
    warm = answer(*learn, "--warm-start", trained)
    light = answer(*learn, "--warm-start", trained, "--without-memory")
    assert len({cold["weights_sha256"], warm["weights_sha256"], light["weights_sha256"]}) == 3
    assert warm["steps"] > light["steps"]  # with a memory it need not wait until it is warm
    run = tmp_path / "run" / "checkpoint"
    before = checkpoint.load(run)[1]
    resumed = answer(*learn, "--resume", run)
    assert resumed["steps"] > before["training"]["steps"] == light["steps"]
    assert "warm start" in refusal(*learn, "--resume", trained)


@needs_data
def test_learn_shows_its_curve_on_held_out_flights(answer, small, tmp_path):
    flights = sorted(DRONE.glob("O1*.mcap")) + sorted(DRONE.glob("O2*.mcap"))[:2]
    said = answer(
        "learn",
        "--recordings",
        *flights,
        "--config",
        small,
        "--output",
        tmp_path,
        "--at-minutes",
        1,
        "--held-out",
        FLIGHT,
    )
    assert said["robot_s"] > 60
    [point] = said["learning_curve"]
    assert point["minute"] == 1
    is_score(point["score"])


NONE = "none.mcap"
FLIGHT_COMMANDS = {
    "label": lambda flight, config, out: ("label", flight, "--config", config, "--output", out / "l.npz"),
    "train": lambda flight, config, out: ("train", flight, "--config", config, "--output", out / "c", "--steps", 1),
    "learn": lambda flight, config, out: ("learn", "--recordings", flight, "--config", config, "--output", out / "r"),
}


@pytest.mark.parametrize("command", FLIGHT_COMMANDS.values(), ids=FLIGHT_COMMANDS.keys())
def test_a_recording_that_is_not_there_is_named(refusal, tmp_path, command):
    said = refusal(*command(tmp_path / NONE, CONFIG, tmp_path))
    assert f"{tmp_path / NONE}: cannot be read: No such file" in said


@pytest.mark.parametrize("command", FLIGHT_COMMANDS.values(), ids=FLIGHT_COMMANDS.keys())
def test_a_configuration_with_a_misspelt_key_is_named(refusal, tmp_path, command):
    config = tmp_path / "bad.toml"
    config.write_text(CONFIG.read_text().replace("window_s", "windows_s"))
    said = refusal(*command(tmp_path / NONE, config, tmp_path))
    assert f"{config}: cannot be used" in said
    assert "labels.windows_s: unknown key (its value: 15.0); did you mean `window_s`?" in said
    said = refusal(*command(tmp_path / NONE, tmp_path / "none.toml", tmp_path))
    assert "none.toml: cannot be read: No such file" in said


@needs_data
@pytest.mark.parametrize("command", FLIGHT_COMMANDS.values(), ids=FLIGHT_COMMANDS.keys())
def test_a_topic_that_is_missing_is_named(refusal, small, tmp_path, command):
    cut = tmp_path / "cut.mcap"
    with Writer(cut, messages.definition) as writer:
        for message in read(FLIGHT):
            if not message.topic.endswith("range"):
                writer.write(message)
    said = refusal(*command(cut, small, tmp_path))
    assert f"{cut}: no message on: range; what came: " in said
    assert "nav_msgs/msg/Odometry" in said


@needs_data
def test_a_checkpoint_that_does_not_fit_is_refused(refusal, small, trained, tmp_path):
    assert "no checkpoint" in refusal("evaluate", tmp_path / "none", FLIGHT, "--config", small)
    assert "do not fit this network" in refusal("evaluate", trained, FLIGHT, "--config", CONFIG)
    for option in ("--warm-start", "--resume"):
        said = refusal("learn", "--recordings", FLIGHT, "--config", CONFIG, "--output", tmp_path / "r", option, trained)
        assert "its network is another than the configuration's" in said


@needs_data
def test_a_recording_without_a_labelled_frame_cannot_be_trained_on(refusal, small, tmp_path):
    config = tmp_path / "far.toml"
    config.write_text(
        small.read_text().replace("start_m = 0.0", "start_m = 90.0").replace("stop_m = 2.0", "stop_m = 92.0")
    )
    said = refusal("train", FLIGHT, "--config", config, "--output", tmp_path / "c", "--steps", 1)
    assert "no labelled frame to train on" in said
    assert not (tmp_path / "c").exists()


@pytest.mark.parametrize("words", [[], ["lern"], ["label"], ["evaluate", "c"], ["train", "a.mcap", "--config"]])
def test_wrong_usage_has_its_own_code(capsys, words):
    with pytest.raises(SystemExit) as ended:
        llrp(*words)
    assert ended.value.code == 2
    assert "usage: llrp" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["label", "train", "evaluate", "learn"])
def test_every_command_has_help_with_an_example(capsys, command):
    with pytest.raises(SystemExit) as ended:
        llrp(command, "--help")
    assert ended.value.code == 0
    out = capsys.readouterr().out
    assert f"  llrp {command} " in out
    assert "--json" in out


def test_help_comes_without_loading_what_learns():
    program = """
import contextlib, io, sys
from agents.cli import COMMANDS, main
out = io.StringIO()
with contextlib.redirect_stdout(out), contextlib.suppress(SystemExit):
    main(["--help"])
assert all(command in out.getvalue() for command in COMMANDS), out.getvalue()
heavy = {"torch", "numpy", "cv2", "onnxruntime", "zenoh", "matplotlib", "pydantic"} & set(sys.modules)
sys.exit(f"loaded: {heavy}" if heavy else 0)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False, cwd=ROOT)
    assert (done.returncode, done.stderr) == (0, "")


def test_the_configuration_decides_about_compiled_code(tmp_path):
    config = tmp_path / "plain.toml"
    config.write_text(Path("configs/thymio.toml").read_text() + "\n[compute]\ncompiled = false\n")
    kernels = Compiled("agents.robots.simulated.kernels")
    for name, there in ((str(config), False), ("configs/thymio.toml", True)):
        words = [
            "record",
            "--simulate",
            "--minutes",
            "0.01",
            "--config",
            name,
            "--output",
            str(tmp_path / f"{there}.mcap"),
        ]
        assert llrp(*words) == 0
        assert (kernels.get() is not None) == there
