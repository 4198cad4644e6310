import subprocess
import sys
import threading
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from llrp_online.configuration import RobotConfiguration, load
from llrp_online.mirror import Mirror
from llrp_online.network import build, standardise
from llrp_online.predictor import Predictor

torch.set_num_threads(1)

CASES = [("paper", 1), ("paper", 3), ("online", 1), ("online", 3)]


@pytest.mark.parametrize(("preset", "cameras"), CASES)
@pytest.mark.parametrize("size", [(64, 80), (45, 51)])
def test_it_equals_the_trained_network(preset, cameras, size):
    shape, outputs = (*size, 3 * cameras), (31, 5)
    network = build(preset, shape, outputs, seed=cameras).eval()
    rng = np.random.default_rng(0)
    with torch.no_grad():
        for parameter in network.parameters():
            parameter += 0.05 * torch.from_numpy(rng.standard_normal(parameter.shape, np.float32))
    predictor = Predictor(preset, shape, outputs)
    predictor.load(network.weights(), version=1)
    flat, dim = np.full(shape, 90, np.uint8), rng.integers(90, 92, shape, dtype=np.uint8)
    for picture in (rng.integers(0, 256, shape, dtype=np.uint8), dim, flat):
        with torch.no_grad():
            expected = torch.sigmoid(network(standardise(picture[None])))[0].numpy()
        np.testing.assert_allclose(predictor.predict(picture).probabilities, expected, atol=1e-5)


@pytest.mark.parametrize("cameras", [1, 3])
def test_with_a_mirror_it_gives_the_mean_of_both_views(cameras):
    shape, outputs = (13, 10, 3 * cameras), (4, 3)
    rng = np.random.default_rng(1)
    mirror = Mirror(rng.permutation(4), np.array([2, 1, 0]), np.arange(cameras)[::-1].copy())
    plain, both = Predictor("online", shape, outputs), Predictor("online", shape, outputs, mirror)
    weights = build("online", shape, outputs, seed=3).weights()
    plain.load(weights, version=1)
    both.load(weights, version=1)
    picture = rng.integers(0, 256, shape, dtype=np.uint8)
    flipped = picture.reshape(13, 10, cameras, 3)[:, ::-1, ::-1].reshape(shape)
    straight, reflected = (np.log(p / (1 - p)) for p in (plain.predict(x).probabilities for x in (picture, flipped)))
    expected = (straight + reflected[mirror.targets][:, mirror.sensors]) / 2
    np.testing.assert_allclose(both.predict(picture).probabilities, 1 / (1 + np.exp(-expected)), atol=1e-5)


def test_a_robot_that_never_saw_a_flipped_picture_predicts_from_the_straight_one():
    configuration = load("configs/thymio.toml")
    assert configuration.averaged_with is not None
    changes = ({"augmentation": {"flip": 0.0}}, {"network": {"mirrored": False}})
    for change in changes:
        told = {**configuration.model_dump(mode="json"), **change}
        assert RobotConfiguration.model_validate(told).averaged_with is None


def constant(probability):
    weights = {name: np.zeros_like(array) for name, array in build("paper", (16, 16, 3), (2, 1)).weights().items()}
    weights["outputs.bias"][:] = np.log(probability / (1 - probability))
    return weights


def test_new_weights_take_effect_and_are_copies():
    predictor = Predictor("paper", (16, 16, 3), (2, 1))
    picture = np.zeros((16, 16, 3), np.uint8)
    assert predictor.version is None
    weights = constant(0.25)
    predictor.load(weights, version=1)
    weights["outputs.bias"][:] = 9  # the caller's array stays the caller's
    first = predictor.predict(picture)
    predictor.load(constant(0.75), version=2)
    second = predictor.predict(picture)
    assert (first.version, second.version, predictor.version) == (1, 2, 2)
    np.testing.assert_allclose(first.probabilities, 0.25, rtol=1e-6)
    np.testing.assert_allclose(second.probabilities, 0.75, rtol=1e-6)


def test_weights_that_nobody_can_write_are_not_copied(monkeypatch):
    predictor, weights, fed = Predictor("paper", (16, 16, 3), (2, 1)), constant(0.25), {}
    weights["dense.weight"].flags.writeable = False
    predictor.load(weights, version=1)
    run = predictor._session.run
    monkeypatch.setattr(
        predictor, "_session", SimpleNamespace(run=lambda names, feed: fed.update(feed) or run(names, feed))
    )
    predictor.predict(np.zeros((16, 16, 3), np.uint8))
    assert [name for name in weights if np.shares_memory(fed[name], weights[name])] == ["dense.weight"]


def test_a_prediction_is_never_of_mixed_weights():
    predictor = Predictor("paper", (16, 16, 3), (2, 1))
    versions = {version: constant(0.1 * version) for version in range(1, 10)}
    predictor.load(versions[1], 1)
    stop = threading.Event()

    def swap():
        while not stop.is_set():
            for version, weights in versions.items():
                predictor.load(weights, version)

    swapper = threading.Thread(target=swap)
    swapper.start()
    picture = np.random.default_rng(0).integers(0, 256, (16, 16, 3), dtype=np.uint8)
    predictions = [predictor.predict(picture) for _ in range(300)]
    stop.set()
    swapper.join()
    assert len({prediction.version for prediction in predictions}) > 1
    for prediction in predictions:
        np.testing.assert_allclose(prediction.probabilities, 0.1 * prediction.version, rtol=1e-5)


def test_it_needs_no_pytorch():
    program = "import sys, llrp_online.predictor, llrp_online.checkpoint; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0


def test_errors_say_what_was_expected():
    predictor = Predictor("paper", (16, 16, 3), (2, 1))
    picture = np.zeros((16, 16, 3), np.uint8)
    with pytest.raises(RuntimeError, match="call load first"):
        predictor.predict(picture)
    weights = constant(0.5)
    with pytest.raises(ValueError, match=r"outputs\.bias: expected \(2,\), got \(3,\)\)"):
        predictor.load({**weights, "outputs.bias": np.zeros(3, np.float32)}, 1)
    del weights["dense.bias"]
    with pytest.raises(ValueError, match=r"dense\.bias: expected \(256,\), got None"):
        predictor.load(weights, 1)
    predictor.load(constant(0.5), 1)
    with pytest.raises(ValueError, match=r"expected \(16, 16, 3\) uint8, got \(8, 16, 3\) uint8"):
        predictor.predict(picture[:8])
    with pytest.raises(ValueError, match="float64"):
        predictor.predict(picture.astype(np.float64))
