"""Auxiliary pretraining: before the first label, the network has learned elsewhere to tell what pictures show."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn
from torch.nn import functional

from agents.commands.train import remember
from agents.experiments.drives import Drive
from agents.experiments.shared import code, digest, made_once
from llrp_online.adam import Adam
from llrp_online.configuration import RobotConfiguration
from llrp_online.learner import Learner
from llrp_online.network import build, standardise

#: Rows and columns of the picture that is to be told again.
_SIZE = (16, 20)


def pretrained(
    configuration: RobotConfiguration, folder: Path, drives: Sequence[Mapping[str, Any]], steps: int
) -> Learner:
    """A learner that begins with the layers of `reconstructing`, but for the last, which begins at random.

    Args:
        configuration: the robot's.
        folder: of what trials share.
        drives: in other places, as JSON values; their labels are not looked at.
        steps: of pretraining.
    """
    learner = Learner(configuration)
    about = (configuration.network.model_dump(mode="json"), configuration.training.seed, list(drives), steps, code())

    def make(part: Path) -> None:
        memory = remember(configuration, [Drive.of(drive).recorded(folder) for drive in drives])
        found = memory.glance(len(memory))
        if found is None:
            raise ValueError("nothing to pretrain on: the drives have no frame with a label")
        layers = reconstructing(configuration, found[1].pictures, steps)
        with part.open("wb") as file:
            np.savez(file, **layers)  # pyright: ignore[reportArgumentType]

    with np.load(made_once(folder / f"pretrained-{digest(*about)}.npz", make)) as layers:
        learner.trainer.become({**learner.trainer.weights(), **layers})
    return learner


def reconstructing(
    configuration: RobotConfiguration, pictures: NDArray[np.uint8], steps: int
) -> dict[str, NDArray[np.float32]]:
    """All layers but the last of a network that learned to tell each picture again, small, from its dense layer.

    Args:
        configuration: `[network]` and `[training]` are used.
        pictures: (M, H, W, C).
        steps: of training.
    """
    torch.set_num_threads(1)
    settings = configuration.training
    network = build(configuration.network.preset, configuration.picture_shape, (1, 1), settings.seed)
    random = np.random.default_rng(settings.seed)
    values = pictures.shape[3] * _SIZE[0] * _SIZE[1]
    head = nn.Linear(network.dense.out_features, values)
    with torch.no_grad():
        head.weight.copy_(torch.from_numpy(random.normal(0, 0.05, tuple(head.weight.shape)).astype(np.float32)))
        head.bias.zero_()
    layers = [*network.convolutions.parameters(), *network.dense.parameters()]
    optimiser = Adam([*layers, *head.parameters()], settings.learning_rate)
    for _ in range(steps):
        batch = standardise(pictures[random.integers(0, len(pictures), settings.batch)])
        told = head(functional.relu(network.dense(network.reference(batch).flatten(1))))
        loss = functional.mse_loss(told, functional.adaptive_avg_pool2d(batch, _SIZE).flatten(1))
        optimiser.zero_grad()
        torch.autograd.backward(loss)
        optimiser.step()
    return {name: array for name, array in network.weights().items() if not name.startswith("outputs.")}
