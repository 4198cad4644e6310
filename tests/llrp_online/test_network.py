import copy
import itertools

import numpy as np
import pytest
import torch
from torch import nn
from torch.nn import functional

from llrp_online.architecture import architecture
from llrp_online.network import Dropout, build, standardise

torch.set_num_threads(1)

ONE_CAMERA, THREE_CAMERAS = (64, 80, 3), (64, 80, 9)


def pictures(count, shape, seed=0):
    return np.random.default_rng(seed).integers(0, 256, (count, *shape), dtype=np.uint8)


def layers(channels, dense, labels, features):
    """The paper's network written down layer by layer, as its figure 5 shows it."""
    trunk = []
    for before, after in itertools.pairwise(channels):
        trunk += [nn.Conv2d(before, after, 3, padding="same"), nn.ReLU(), nn.MaxPool2d(2)]
    head = [nn.Flatten(), nn.Dropout(0.2), nn.Linear(features, dense), nn.ReLU(), nn.Linear(dense, labels)]
    return nn.Sequential(*trunk, *head).eval()


@pytest.mark.parametrize(
    ("shape", "outputs", "channels", "dense", "features"),
    [
        (ONE_CAMERA, (31, 5), (3, 10, 10, 8), 256, 640),
        (THREE_CAMERAS, (289, 1), (9, 20, 12, 10, 8), 512, 160),
    ],
)
def test_paper_is_the_papers_network(shape, outputs, channels, dense, features):
    network = build("paper", shape, outputs, seed=1).eval()
    reference = layers(channels, dense, outputs[0] * outputs[1], features)
    parameters = dict(zip(reference.state_dict(), network.weights().values(), strict=True))
    reference.load_state_dict({name: torch.from_numpy(array) for name, array in parameters.items()})
    x = standardise(pictures(4, shape))
    with torch.no_grad():
        torch.testing.assert_close(network(x), reference(x).reshape(4, *outputs))


def test_dropout_of_each_preset():
    assert architecture("paper", 3).dropout == 0.2
    assert architecture("paper", 9).dropout == 0.0
    assert architecture("online", 3).dropout == architecture("online", 9).dropout == 0.7


@pytest.mark.parametrize("preset", ["paper", "online"])
@pytest.mark.parametrize("shape", [ONE_CAMERA, THREE_CAMERAS, (8, 8, 3), (9, 13, 6), (61, 83, 3)])
def test_any_picture_size_gives_every_logit(preset, shape):
    network = build(preset, shape, (7, 2))
    logits = network(standardise(pictures(2, shape)))
    assert logits.shape == (2, 7, 2)
    assert {name: p.shape for name, p in network.named_parameters()} == architecture(preset, shape[2]).parameters(
        shape, (7, 2)
    )


def test_online_widths_are_multiples_of_16_and_nothing_keeps_batch_statistics():
    assert all(block.channels % 16 == 0 for block in architecture("online", 3).blocks)
    assert not list(build("online", ONE_CAMERA, (31, 5)).buffers())


def test_a_seed_gives_the_same_weights_and_leaves_the_global_generator_alone():
    before = torch.get_rng_state()
    first, again, other = (build("online", ONE_CAMERA, (31, 5), seed) for seed in (3, 3, 4))
    x = standardise(pictures(4, ONE_CAMERA))
    assert torch.equal(first(x), again(x))  # dropout included
    assert not torch.equal(first(x), other(x))
    assert torch.equal(torch.get_rng_state(), before)


def test_weights_go_from_one_network_to_another():
    first, second = (build("online", ONE_CAMERA, (31, 5), seed).eval() for seed in (0, 1))
    weights = first.weights()
    for array in weights.values():
        array.flags.writeable = False  # as arrays out of a file may be
    second.set_weights(weights)
    x = standardise(pictures(2, ONE_CAMERA))
    assert torch.equal(first(x), second(x))
    with torch.no_grad():
        first.dense.bias += 1
    assert not np.array_equal(first.weights()["dense.bias"], weights["dense.bias"])


def test_set_weights_names_what_does_not_fit():
    network = build("paper", ONE_CAMERA, (31, 5))
    with pytest.raises(RuntimeError, match=r"dense\.weight"):
        network.set_weights(build("paper", (32, 32, 3), (31, 5)).weights())


def test_a_copy_draws_its_own_dropout():
    network = build("paper", ONE_CAMERA, (31, 5))
    twin = copy.deepcopy(network)
    x = standardise(pictures(2, ONE_CAMERA))
    assert torch.equal(network(x), twin(x))


def test_dropout_keeps_the_mean():
    dropout = Dropout(0.2, torch.Generator().manual_seed(0))
    dropped = dropout(torch.ones(200_000))
    assert float(dropped.mean()) == pytest.approx(1, abs=0.01)
    assert set(dropped.unique().tolist()) == {0.0, 1.25}
    assert dropout.eval()(torch.ones(3)).tolist() == [1, 1, 1]


@pytest.mark.parametrize(
    ("preset", "channels", "message"),
    [("paper", 4, "3 for each camera, got 4"), ("deep", 3, "'online' or 'paper', got 'deep'")],
)
def test_errors_say_what_was_expected(preset, channels, message):
    with pytest.raises(ValueError, match=message):
        build(preset, (64, 80, channels), (31, 5))


def test_standardised_pictures_have_mean_zero_and_deviation_one():
    raw = pictures(5, THREE_CAMERAS)
    x = standardise(raw)
    assert x.shape == (5, 9, 64, 80)
    assert x.dtype == torch.float32
    assert x.is_contiguous(memory_format=torch.channels_last)
    flat = raw.reshape(5, -1).astype(np.float64)
    expected = (flat - flat.mean(1, keepdims=True)) / flat.std(1, keepdims=True)
    np.testing.assert_allclose(x.permute(0, 2, 3, 1).reshape(5, -1).numpy(), expected, atol=1e-5)


def test_a_flat_picture_becomes_zeros_not_nan():
    assert torch.equal(standardise(np.full((1, 8, 8, 3), 255, np.uint8)), torch.zeros(1, 3, 8, 8))


def test_standardise_leaves_its_input_and_takes_views_and_floats():
    raw = pictures(3, ONE_CAMERA).astype(np.float32)
    before = raw.copy()
    expected = standardise(raw)
    assert np.array_equal(raw, before)
    raw.flags.writeable = False
    assert torch.equal(standardise(raw[::-1]), expected.flip(0))


def test_both_presets_can_learn_one_batch_by_heart():
    rng = np.random.default_rng(0)
    x = standardise(pictures(8, ONE_CAMERA))
    truth = torch.from_numpy(rng.integers(0, 2, (8, 3, 2)).astype(np.float32))
    for preset in ("paper", "online"):
        network = build(preset, ONE_CAMERA, (3, 2))
        optimiser = torch.optim.Adam(network.parameters(), 3e-3)
        for _ in range(60):
            optimiser.zero_grad()
            loss = functional.binary_cross_entropy_with_logits(network(x), truth)
            loss.backward()
            optimiser.step()
        assert float(loss.detach()) < 0.1
