"""`llrp export`: the file answers as the network does, says how to feed it, and needs nothing else."""

import json
import re
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import onnx
import onnxruntime
import pytest

from agents.cli import main
from agents.frames import frames_of
from llrp_online import checkpoint, export
from llrp_online.calibration import Calibration
from llrp_online.configuration import RobotConfiguration, load, validate
from llrp_online.network import build
from llrp_online.predictor import Predictor

ROOT = Path(__file__).parents[2]
CONFIG = ROOT / "configs" / "thymio.toml"
PAGE = ROOT / "docs" / "export.md"


def llrp(*words) -> int:
    return main([str(word) for word in words])


@pytest.fixture(scope="module")
def drive(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("export") / "drive.mcap"
    words = ("--simulate", "--minutes", 0.5, "--behaviour", "walk", "--output", path)
    assert llrp("record", *words) == 0
    return path


@pytest.fixture(scope="module")
def trained(drive) -> Path:
    """A checkpoint with a memory of real frames."""
    path = drive.with_name("checkpoint")
    assert llrp("train", drive, "--config", CONFIG, "--output", path, "--steps", 5) == 0
    return path


@pytest.fixture
def eyes(trained, tmp_path, capsys) -> Path:
    assert llrp("export", trained, "--onnx", tmp_path / "eyes.onnx") == 0
    capsys.readouterr()
    return tmp_path / "eyes.onnx"


def weights_of(path):
    return checkpoint.load(path)[0]["weights"]


def test_it_says_on_how_many_frames_it_was_checked_and_how_far_it_is_off(trained, tmp_path, capsys):
    file = tmp_path / "deep" / "eyes.onnx"
    assert llrp("export", trained, "--onnx", file, "--frames", 40, "--json") == 0
    said = json.loads(capsys.readouterr().out)
    assert said["frames"] == 40
    assert 0 <= said["largest_difference"] < 1e-4
    assert said["metadata"] == onnxruntime.InferenceSession(file).get_modelmeta().custom_metadata_map
    assert said["metadata"]["checked_frames"] == "40"
    assert float(said["metadata"]["largest_difference"]) == pytest.approx(said["largest_difference"], rel=1e-2)
    assert llrp("export", trained, "--onnx", file) == 0
    assert re.match(r"\d+ frames, largest difference \S+ \(at most 0.0001\); saved to ", capsys.readouterr().out)


def test_the_file_answers_as_the_network_does_on_another_drives_frames(eyes, trained, drive):
    configuration = load(CONFIG)
    predictor = Predictor.of(configuration)
    predictor.load(weights_of(trained), 0)
    session = onnxruntime.InferenceSession(eyes)
    pictures = [frame.picture for frame in frames_of(configuration, drive)]
    assert len(pictures) == 300
    for picture in pictures[::30]:
        [found] = session.run(["probabilities"], {"picture": picture[None]})
        np.testing.assert_allclose(found, predictor.predict(picture).probabilities, atol=1e-5)


def test_recordings_are_checked_on_instead_of_the_memory(trained, drive, tmp_path, capsys):
    words = ("export", trained, "--onnx", tmp_path / "eyes.onnx", "--recordings", drive, "--json")
    assert llrp(*words) == 0
    assert json.loads(capsys.readouterr().out)["frames"] == 300


def test_a_file_that_differs_too_much_is_not_written(trained, tmp_path, capsys):
    file = tmp_path / "eyes.onnx"
    assert llrp("export", trained, "--onnx", file, "--tolerance", "1e-12") == 1
    assert "not written: it differs from the network by" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_other_weights_in_the_file_are_found_out(trained, drive):
    """What the check is for: a file that is not the network's."""
    configuration = load(CONFIG)
    weights = weights_of(trained)
    other = build("online", configuration.picture_shape, (31, 5), seed=9).weights()
    pictures = [frame.picture for frame in frames_of(configuration, drive)][:5]
    mine = export.Trained(configuration, weights, 0)
    found = export.compare(export.exported(export.Trained(configuration, other, 0)), mine, pictures)
    assert (found.frames, found.largest_difference > 0.01) == (5, True)
    broken = {**weights, "outputs.bias": np.full_like(weights["outputs.bias"], np.nan)}
    found = export.compare(export.exported(export.Trained(configuration, broken, 0)), mine, pictures)
    assert np.isnan(found.largest_difference)
    del other["dense.bias"]
    with pytest.raises(ValueError, match="another network's"):
        export.exported(export.Trained(configuration, other, 0))


def test_a_calibration_is_in_the_file(trained, drive):
    configuration = load(CONFIG)
    pictures = [frame.picture for frame in frames_of(configuration, drive)][:5]
    plain = export.Trained(configuration, weights_of(trained), 0)
    calibration = Calibration(np.linspace(0.5, 2.0, 31), np.linspace(-1.0, 1.0, 31))
    calibrated = export.Trained(configuration, weights_of(trained), 0, calibration)
    model = export.exported(calibrated)
    assert export.compare(model, calibrated, pictures).largest_difference < 1e-5
    assert export.compare(model, plain, pictures).largest_difference > 0.1
    assert json.loads(export.metadata(model)["calibration"]) == calibration.as_json()
    assert export.metadata(export.exported(plain))["calibration"] == "none"


def test_a_checkpoint_without_frames_asks_for_recordings(trained, tmp_path, capsys):
    manifest = checkpoint.load(trained)[1]
    bare = {name: manifest[name] for name in ("configuration", "version")}
    checkpoint.save(tmp_path / "bare", {"weights": weights_of(trained)}, bare)
    assert llrp("export", tmp_path / "bare", "--onnx", tmp_path / "eyes.onnx") == 1
    assert "remembers no frame to check on; give --recordings" in capsys.readouterr().err
    checkpoint.save(tmp_path / "bare", {"weights": weights_of(trained)}, {"version": 0})
    assert llrp("export", tmp_path / "bare", "--onnx", tmp_path / "eyes.onnx") == 1
    assert "its manifest has no configuration" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["pioneer", "drone"])
def test_the_metadata_are_those_of_the_robot(name):
    configuration = load(ROOT / "configs" / f"{name}.toml")
    outputs = configuration.outputs
    network = build(configuration.network.preset, configuration.picture_shape, outputs)
    model = export.exported(export.Trained(configuration, network.weights(), 3))
    facts = export.metadata(model)
    assert json.loads(facts["cameras"]) == [camera.topic for camera in configuration.camera]
    assert json.loads(facts["sensors"]) == configuration.sensors
    np.testing.assert_allclose(json.loads(facts["targets"]), configuration.targets.build().poses)
    height, width, channels = (d.dim_value for d in model.graph.input[0].type.tensor_type.shape.dim[1:])
    assert (height, width) == (int(facts["height"]), int(facts["width"]))
    assert channels == 3 * len(configuration.camera)
    sensor = configuration.short_range[0]
    assert json.loads(facts["bits"])[0].startswith(f"{sensor.topic} {sensor.field} ")


def test_the_digest_tells_configurations_apart(eyes):
    facts = export.metadata(onnx.load(eyes))
    configuration = load(CONFIG)
    weights = build("online", configuration.picture_shape, (31, 5)).weights()
    again = export.exported(export.Trained(configuration, weights, 0))
    assert export.metadata(again)["configuration_sha256"] == facts["configuration_sha256"]
    raw = configuration.model_dump(mode="json")
    raw["labels"]["window_s"] = 5.0
    other = validate(raw, RobotConfiguration, "test")
    again = export.exported(export.Trained(other, weights, 0))
    assert export.metadata(again)["configuration_sha256"] != facts["configuration_sha256"]


def test_the_page_names_all_metadata(eyes):
    table = PAGE.read_text(encoding="utf-8").partition("| metadata |")[2].partition("\n\n")[0]
    named = {key for row in table.splitlines()[2:] for key in re.findall(r"`(\w+)`", row.split("|")[1])}
    assert named == set(export.metadata(onnx.load(eyes)))


def test_the_example_of_the_page_sees_what_we_see_and_needs_nothing_of_ours(eyes, trained, drive, tmp_path):
    [program] = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    assert len(program.splitlines()) <= 34
    # Anything else that the example imported would fail to.
    fence = (
        "import sys\nclass Fence:\n    def find_spec(self, name, path=None, target=None):\n"
        "        if name.partition('.')[0] in ('cv2', 'torch', 'agents', 'llrp_online', 'replay', 'onnx', 'PIL'):\n"
        "            raise ImportError(name)\nsys.meta_path.insert(0, Fence())\n"
    )
    (tmp_path / "predict.py").write_text(fence + program + 'np.save("resized.npy", np.rint(resized))\n')
    configuration = load(CONFIG)
    small = next(iter(frames_of(configuration, drive))).picture
    picture = cv2.resize(small, (323, 245), interpolation=cv2.INTER_CUBIC)
    np.save(tmp_path / "picture.npy", picture)
    words = [sys.executable, "predict.py", str(eyes), "picture.npy"]
    done = subprocess.run(words, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    # OpenCV resizes in fixed point, a level away here and there.
    wanted = cv2.resize(picture, (80, 64), interpolation=cv2.INTER_LINEAR)
    assert np.abs(np.load(tmp_path / "resized.npy") - wanted).max() <= 1
    rows = [re.findall(r"(?:left|center|right) ([\d.]+)", line) for line in done.stdout.splitlines()]
    predictor = Predictor.of(configuration)
    predictor.load(weights_of(trained), 0)
    expected = predictor.predict(wanted).probabilities
    np.testing.assert_allclose(np.array(rows, float), expected, atol=0.02)
