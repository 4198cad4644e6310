"""The compiled blocks against the layers written down in `Network`."""

import copy
import sys
from contextlib import nullcontext

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch.nn import functional

from llrp_online.blocks import Blocks
from llrp_online.network import build, standardise
from replay.compiling import plainly

kernels = pytest.importorskip("llrp_online.blocks.kernels")

ONE_CAMERA = (64, 80, 3)


def plain(pictures, parameters, blocks):
    """The chain, layer by layer."""
    x = pictures
    for index, (_, kernel, stride) in enumerate(blocks):
        weight, bias = parameters[2 * index : 2 * index + 2]
        x = functional.conv2d(x, weight, bias, stride, kernel // 2)
        x = functional.relu(functional.max_pool2d(x, 2, ceil_mode=True))
    return x


def drawn(blocks, shape, count, seed):
    """Pictures, parameters and a gradient at the end."""
    generator = torch.Generator().manual_seed(seed)
    channels, parameters = shape[2], []
    for width, kernel, _ in blocks:
        scale = (channels * kernel**2) ** -0.5
        parameters += [torch.randn((width, channels, kernel, kernel), generator=generator) * scale]
        parameters += [torch.randn(width, generator=generator) * 0.1]
        channels = width
    pictures = torch.randn((count, shape[2], *shape[:2]), generator=generator)
    after = plain(pictures, parameters, blocks)
    return pictures, [p.requires_grad_() for p in parameters], torch.randn(after.shape, generator=generator)


def gradients(out, gradient, parameters):
    return torch.autograd.grad(out, parameters, gradient)


def assert_close(ours, reference):
    """Up to a hundred thousandth of the largest."""
    assert ours.shape == reference.shape
    torch.testing.assert_close(ours, reference, rtol=1e-5, atol=1e-5 * max(reference.detach().abs().max().item(), 1e-3))


chains = st.lists(st.tuples(st.integers(1, 21), st.sampled_from([1, 3, 5]), st.integers(1, 2)), min_size=1, max_size=2)


@settings(max_examples=6)  # each compiles kernels of its own
@given(
    blocks=chains,
    shape=st.tuples(st.integers(1, 19), st.integers(1, 19), st.integers(1, 6)),
    count=st.integers(1, 3),
    seed=st.integers(0, 99),
)
def test_blocks_of_any_shape_give_what_the_layers_give(blocks, shape, count, seed):
    pictures, parameters, gradient = drawn(blocks, shape, count, seed)
    reference, ours = plain(pictures, parameters, blocks), Blocks(kernels.build(blocks, shape))(pictures, parameters)
    assert_close(ours, reference)
    for one, other in zip(
        gradients(ours, gradient, parameters), gradients(reference, gradient, parameters), strict=True
    ):
        assert_close(one, other)


@pytest.mark.parametrize("preset", ["paper", "online"])
@pytest.mark.parametrize("shape", [ONE_CAMERA, (16, 24, 9)])
def test_a_network_gives_the_same_gradients_either_way(preset, shape):
    pictures = np.random.default_rng(0).integers(0, 256, (16, *shape), dtype=np.uint8)
    losses, found = [], []
    for form in (nullcontext, plainly):
        network = build(preset, shape, (31, 5), seed=1)
        with form():
            loss = network(standardise(pictures)).square().mean()
            found.append(torch.autograd.grad(loss, list(network.parameters())))
        losses.append(loss.detach())
    torch.testing.assert_close(*losses)
    for ours, reference in zip(*found, strict=True):
        assert_close(ours, reference)


def test_of_equals_the_first_gets_the_gradient_and_what_is_cut_off_none():
    blocks, shape = [(3, 3, 1)], (6, 6, 3)
    pictures, parameters, gradient = drawn(blocks, shape, 2, 0)
    with torch.no_grad():
        parameters[1].copy_(torch.tensor([1.0, 0.0, -1.0]))
    flat = torch.zeros_like(pictures)
    flat[1] = pictures[1].round()
    reference, ours = plain(flat, parameters, blocks), Blocks(kernels.build(blocks, shape))(flat, parameters)
    assert_close(ours, reference)
    for one, other in zip(
        gradients(ours, gradient, parameters), gradients(reference, gradient, parameters), strict=True
    ):
        assert_close(one, other)


def test_a_lost_number_is_not_hidden():
    network = build("paper", (16, 16, 3), (3, 2)).eval()
    assert network(torch.full((1, 3, 16, 16), float("nan"))).isnan().all()


def test_the_same_batch_gives_the_same_bits_whatever_came_before():
    blocks, shape = [(10, 3, 1), (8, 3, 1)], (16, 24, 3)
    used = Blocks(kernels.build(blocks, shape))
    for count in (5, 2, 7):
        pictures, parameters, gradient = drawn(blocks, shape, count, count)
        fresh = Blocks(kernels.build(blocks, shape))
        out, other = used(pictures, parameters), fresh(pictures, parameters)
        assert torch.equal(out, other)
        found = zip(gradients(out, gradient, parameters), gradients(other, gradient, parameters), strict=True)
        assert all(torch.equal(*pair) for pair in found)


def test_no_way_back_once_another_batch_was_seen():
    network = build("paper", (16, 16, 3), (3, 2))
    x = torch.zeros(1, 3, 16, 16)
    earlier = network(x).sum()
    network(x)
    with pytest.raises(RuntimeError, match="another batch"):
        torch.autograd.backward(earlier)


def test_pictures_of_another_size_are_refused():
    with pytest.raises(RuntimeError, match=r"expected \(N, 16, 16, 3\), got \(1, 16, 20, 3\)"):
        build("paper", (16, 16, 3), (3, 2))(torch.zeros(1, 3, 16, 20))


def test_a_network_that_has_run_can_be_copied():
    network = build("paper", (16, 16, 3), (3, 2)).eval()
    x = torch.ones(2, 3, 16, 16)
    out = network(x)
    assert torch.equal(copy.deepcopy(network)(x), out)


def test_without_numba_the_layers_run(monkeypatch, caplog):
    monkeypatch.setitem(sys.modules, "numba", None)
    shape = (14, 18, 3)  # that no other test compiles for
    network, x = build("paper", shape, (3, 2)).eval(), torch.ones(2, 3, *shape[:2])
    found = network(x)
    with plainly():
        assert torch.equal(found, network(x))
    assert "going on without compiled code" in caplog.text
