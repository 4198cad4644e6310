"""Learners that only the study of choices tries: each differs from the usual one as it says, and learns."""

from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from agents.experiments import ablate
from agents.experiments.drives import Drive
from agents.experiments.settings import configuration_of, robot_of, scenario
from agents.experiments.variants import made
from agents.experiments.variants.consistency import ConsistentLearner, disagreement
from agents.experiments.variants.free_space import filled
from agents.experiments.variants.pretraining import reconstructing
from agents.experiments.variants.squared import SquaredErrorTrainer
from agents.replayed import learn_over
from llrp_online.configuration import RobotConfiguration

BITS = npst.arrays(np.int8, st.tuples(st.just(2), st.integers(1, 9), st.just(2)), elements=st.integers(-1, 1))


@pytest.fixture(scope="module")
def thymio() -> RobotConfiguration:
    return configuration_of("thymio")


@pytest.fixture(scope="module")
def drives(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("drives")


@given(BITS, st.integers(0, 9))
def test_free_space_adds_negatives_between_silent_poses_and_nothing_else(bits: np.ndarray, reach: int) -> None:
    weight = np.where(bits >= 0, np.linspace(0.1, 1.0, bits.size).reshape(bits.shape), 0).astype(np.float32)
    found, weighed = filled(bits, weight, np.arange(bits.shape[1], dtype=np.float64), float(reach))
    for frame, sensor in np.ndindex(2, 2):
        before = bits[frame, :, sensor]
        for target, label in enumerate(found[frame, :, sensor]):
            earlier = [t for t in range(target) if before[t] >= 0][-1:]
            later = [t for t in range(target + 1, len(before)) if before[t] >= 0][:1]
            between = before[target] < 0 and earlier and later and later[0] - earlier[0] <= reach
            if between and before[earlier[0]] == before[later[0]] == 0:
                assert label == 0
                assert weighed[frame, target, sensor] == weight[frame, [earlier[0], later[0]], sensor].min()
            else:
                assert label == before[target]
                assert weighed[frame, target, sensor] == weight[frame, target, sensor]


@given(st.integers(1, 5), st.integers(0, 9))
def test_frames_that_say_the_same_of_the_same_places_do_not_disagree(ahead: int, seed: int) -> None:
    world = torch.rand((20, 3), generator=torch.Generator().manual_seed(seed))
    seen = torch.stack([world[:12], world[ahead : 12 + ahead]])
    assert float(disagreement(seen, np.array([ahead]))) == 0.0
    assert float(disagreement(seen + torch.tensor([0.0, 0.5])[:, None, None], np.array([ahead]))) == pytest.approx(0.25)


def test_the_squared_error_passes_unknown_labels_over(thymio: RobotConfiguration) -> None:
    trainer = SquaredErrorTrainer(thymio)
    trainer.network.eval().requires_grad_(requires_grad=False)
    shape, counts = (2, *thymio.outputs), np.zeros((*thymio.outputs, 2), np.int64)
    pictures, weight = torch.zeros((2, 3, 64, 80)), torch.ones(shape)
    labels = torch.full(shape, -1, dtype=torch.int8)
    assert float(trainer.loss(pictures, labels, weight, counts)) == 0.0
    labels[0, 3, 2] = 1
    expected = (1 - torch.sigmoid(trainer.network(pictures)[0, 3, 2])) ** 2 * thymio.training.positive_weight_max
    counts[3, 2] = 100, 1
    assert float(trainer.loss(pictures, labels, weight, counts)) == pytest.approx(float(expected))


def test_pairs_were_taken_along_one_line(thymio: RobotConfiguration, drives: Path) -> None:
    learner = ConsistentLearner(thymio, 1.0)
    learn_over(learner, [Drive(robot_of(thymio), scenario("tiles"), 0, 0.5, "seek").recorded(drives)])
    assert learner.trainer.steps > 0
    pairs = [found for found in (learner._pairs() for _ in range(20)) if found is not None]
    assert pairs
    for found in pairs:
        assert found.pictures.shape == (2 * len(found.ahead), *thymio.picture_shape)
        assert 1 <= found.ahead.min() <= found.ahead.max() < len(thymio.targets.build())


def test_pretraining_tells_pictures_apart(thymio: RobotConfiguration) -> None:
    pictures = np.random.default_rng(0).integers(0, 256, (8, *thymio.picture_shape), np.uint8)
    layers = reconstructing(thymio, pictures, 2)
    usual = made(thymio, Path(), None).trainer.weights()
    assert layers.keys() | {"outputs.weight", "outputs.bias"} == usual.keys()
    assert all(layers[name].shape == usual[name].shape for name in layers)


@pytest.mark.slow
@pytest.mark.parametrize("form", [form for form, told in ablate.FORMS.items() if "variant" in told])
def test_each_variant_learns(form: str, drives: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ablate, "PRETRAINING_STEPS", 3)
    size = ablate.Size(("tiles",), (0,), (20,), 0.2, 24.0, ("as configured", form))
    usual, other = (trial.run(drives) for trial in ablate.trials(size))
    assert other["marks"][0]["steps"] == usual["marks"][0]["steps"] > 0
    assert other["weights_sha256"] != usual["weights_sha256"]


def test_an_unknown_variant_is_refused(thymio: RobotConfiguration) -> None:
    with pytest.raises(ValueError, match=r"got \{'name': 'telepathy'\}"):
        made(thymio, Path(), {"name": "telepathy"})
