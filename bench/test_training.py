"""A training step of the paper's network, beside PyTorch's and beside one matrix product of as many operations."""

from contextlib import nullcontext

import numpy as np
import pytest
import torch
from torch import nn

from bench import eager
from llrp_online import losses
from llrp_online.augment import Augmenter
from llrp_online.configuration import load
from llrp_online.configuration.learning import Network
from llrp_online.network import build, standardise
from llrp_online.trainer import Trainer
from replay.buffer import BufferSettings, ReplayBuffer
from replay.compiling import plainly

BATCH, FRAMES, SHORT_FRAMES = 64, 5000, 500
ROBOT = load("configs/thymio.toml")
PAPER = ROBOT.model_copy(update={"network": Network(preset="paper")})
OUTPUTS = (len(ROBOT.targets.build()), len(ROBOT.sensors))
#: Rows and columns of the matrix that shows what a core can do.
SIDE = 1024


def frames(count):
    """Pictures, labels of which a third is unknown, weights."""
    rng = np.random.default_rng(0)
    labels = rng.integers(-1, 2, (count, *OUTPUTS)).astype(np.int8)
    weight = rng.random(labels.shape, np.float32)
    return rng.integers(0, 256, (count, *ROBOT.picture_shape), dtype=np.uint8), labels, weight


def filled(pictures, labels, weight):
    settings = BufferSettings(
        budget_bytes=10**9, recent_frames=len(pictures), recent_share=1.0, max_uses=10**9, duplicate_distance=0.0
    )
    buffer = ReplayBuffer(ROBOT.picture_shape, OUTPUTS, settings)
    for frame in enumerate(zip(pictures, labels, weight, strict=True)):
        buffer.add(frame[0], *frame[1])
    return buffer


def multiply_adds():
    """Of a step, if it skipped nothing: forth, and back to weights and inputs, but not to the pictures. Each is 2."""
    total, (height, width, _) = 0, ROBOT.picture_shape
    trunk = eager.network(ROBOT.picture_shape, OUTPUTS)
    for index, layer in enumerate(layer for layer in trunk if isinstance(layer, nn.Conv2d | nn.Linear)):
        positions = height * width if isinstance(layer, nn.Conv2d) else 1
        total += positions * layer.weight.numel() * (3 if index else 2)
        height, width = -(-height // 2), -(-width // 2)
    return BATCH * total


@pytest.fixture
def peers_of(short):
    """Our step, and PyTorch's two, over the same frames."""
    memory = frames(SHORT_FRAMES if short else FRAMES)
    buffer, random = filled(*memory), np.random.default_rng(1)
    augment = Augmenter(ROBOT.augmentation, ROBOT.mirror())
    one_by_one = eager.OneByOne(ROBOT)

    def as_ours(pictures, labels, weight):
        augmented = augment(pictures, labels, weight, random)
        return standardise(augmented.pictures), augmented.labels, augmented.weight

    def ours(form):
        trainer = Trainer(PAPER)

        def work():
            with form():
                trainer.step(buffer.sample(BATCH), buffer.class_counts)

        return work

    def peer(prepare, memory_format, **options):
        step = eager.Step(ROBOT.picture_shape, OUTPUTS, memory_format, **options)

        def work():
            rows = random.integers(0, len(memory[0]), BATCH)
            balance = losses.positive_weights(buffer.class_counts, ROBOT.training.positive_weight_max)
            step(*prepare(*(array[rows] for array in memory)), balance)

        return work

    return ours(nullcontext), {
        "PyTorch eager, numpy a sample": peer(one_by_one, torch.contiguous_format),
        "PyTorch channels_last, inputs as ours": peer(as_ours, torch.channels_last, fused=True),
        "the plain reference": ours(plainly),
    }


def test_training_step(race, peers_of):
    ours, peers = peers_of
    operations = 2 * multiply_adds()
    left, right = torch.randn(operations // (2 * SIDE**2), SIDE), torch.randn(SIDE, SIDE)
    dense = "its operations as one matrix product"
    race(
        "training step, paper's network, batch 64, gather and augmentation included",
        ours,
        {**peers, dense: lambda: left @ right},
        # At least 30 % of what a core can do.
        {"PyTorch eager, numpy a sample": 4, "PyTorch channels_last, inputs as ours": 2, dense: 0.3},
        rounds=20,
        note=f"{operations / 1e9:.3f} GFLOP, counted dense: as if pooled-away numbers had gradients too. "
        f"The matrix product is of ({len(left)}, {SIDE}) and ({SIDE}, {SIDE})",
    )


def test_gradients_are_autograds():
    pictures, labels, weight = frames(BATCH)
    x, found = standardise(pictures), []
    for form in (nullcontext, plainly):
        network = build("paper", ROBOT.picture_shape, OUTPUTS)
        with form():
            loss = losses.cross_entropy(network(x), torch.from_numpy(labels), torch.from_numpy(weight))
            found.append(torch.autograd.grad(loss, list(network.parameters())))
    for ours, reference in zip(*found, strict=True):
        assert float((ours - reference).abs().max()) < 1e-5 * float(reference.abs().max())
