"""One training step: a batch, augmented, through the network, its masked loss back, and the weights averaged.

Plain and sequential, with its own random numbers: the same batches and seed give the same weights, bit for bit, on one
thread. Training on more threads than one is slower here, and starves whoever needs the other core.
"""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from llrp_online import losses
from llrp_online.adam import MOMENTS, Adam
from llrp_online.architecture import Weights
from llrp_online.augment import Augmenter
from llrp_online.checkpoint import numpy_generator, numpy_state, set_torch_state, torch_state
from llrp_online.configuration import RobotConfiguration
from llrp_online.network import build, standardise
from llrp_online.preparation import Preparation
from replay.batch import Batch


class Trainer:
    """The network that learns, its optimiser, and the running average of its weights.

    Args:
        configuration: the robot's; `[network]`, `[training]`, `[augmentation]` and the rig's mirror image are used.
    """

    def __init__(self, configuration: RobotConfiguration) -> None:
        torch.set_num_threads(1)
        self._settings = settings = configuration.training
        outputs = configuration.outputs
        self.network = build(configuration.network.preset, configuration.picture_shape, outputs, settings.seed)
        self._judge = build(configuration.network.preset, configuration.picture_shape, outputs, settings.seed).eval()
        self._optimiser = Adam(self.network.parameters(), settings.learning_rate)
        self._prepare = Preparation(Augmenter(configuration.augmentation, configuration.mirror()))
        self._random = np.random.default_rng(settings.seed)
        self._names = [name for name, _ in self.network.named_parameters()]
        self._average = [parameter.detach().clone() for parameter in self.network.parameters()]
        self.steps = 0

    def step(self, batch: Batch, class_counts: NDArray[np.int64]) -> float:
        """Learn from one batch; `class_counts` (T, S, 2) of the memory it was drawn from weigh the positives.

        Returns:
            The loss.
        """
        prepared = self._prepare(batch, self._random)
        labels, weight = torch.from_numpy(prepared.labels), torch.from_numpy(prepared.weight)
        self.network.train()
        loss = self.loss(torch.from_numpy(prepared.pictures).permute(0, 3, 1, 2), labels, weight, class_counts)
        self._optimiser.zero_grad()
        torch.autograd.backward(loss)
        self._optimiser.step()
        self.steps += 1
        self._move_average()
        return float(loss.detach())

    def loss(self, pictures: Tensor, labels: Tensor, weight: Tensor, class_counts: NDArray[np.int64]) -> Tensor:
        """What a step makes less: of pictures (N, C, H, W), standardised, and their labels and weights, (N, T, S)."""
        return self.error(self.network(pictures), labels, weight, class_counts)

    def error(self, logits: Tensor, labels: Tensor, weight: Tensor, class_counts: NDArray[np.int64]) -> Tensor:
        """How wrong logits (N, T, S) are, by the loss that is configured."""
        if self._settings.loss == "paper":
            return losses.paper(logits, labels, weight)
        balance = losses.positive_weights(class_counts, self._settings.positive_weight_max)
        return losses.cross_entropy(logits, labels, weight, balance)

    def _move_average(self) -> None:
        # Early on the average would still hold the random start: it follows closely first, then ever more calmly.
        decay = min(self._settings.average, self.steps / (self.steps + 9.0))
        with torch.no_grad():
            torch._foreach_lerp_(self._average, list(self.network.parameters()), 1.0 - decay)  # pyright: ignore[reportPrivateUsage, reportPrivateImportUsage]

    def weights(self) -> Weights:
        """The averaged weights, what predicts: a copy that nobody can change, so that it may be handed to anybody."""
        found: Weights = {}
        for name, average in zip(self._names, self._average, strict=True):
            found[name] = np.array(average.numpy(), order="C")
            found[name].flags.writeable = False
        return found

    def become(self, weights: Weights) -> None:
        """Go on from these weights, with a fresh optimiser."""
        self.network.set_weights(weights)
        self._optimiser.forget()
        for average, parameter in zip(self._average, self.network.parameters(), strict=True):
            average.copy_(parameter.detach())

    def judge(self, weights: Weights, batch: Batch) -> float | None:
        """Masked log-loss of `weights` on a batch as it is [nats]; None where no label is known."""
        if not (batch.labels >= 0).any():
            return None
        self._judge.set_weights(weights)
        with torch.inference_mode():
            logits = self._judge(standardise(batch.pictures))
            loss = losses.cross_entropy(logits, torch.from_numpy(batch.labels), torch.from_numpy(batch.weight))
        return float(loss)

    def state(self) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """Arrays and JSON values that `restore` takes back exactly."""
        arrays: dict[str, NDArray[Any]] = {}
        named, moments_of_each = self.network.named_parameters(), self._optimiser.moments
        for (name, parameter), average, moments in zip(named, self._average, moments_of_each, strict=True):
            arrays[f"network.{name}"] = parameter.detach().contiguous().numpy().copy()
            arrays[f"average.{name}"] = average.contiguous().numpy().copy()
            for key, value in moments.items():
                arrays[f"{key}.{name}"] = value.contiguous().numpy().copy()
        values = {
            "steps": self.steps,
            "random": numpy_state(self._random),
            "dropout": torch_state(self.network.dropout.generator),
        }
        return arrays, values

    def restore(self, arrays: dict[str, NDArray[Any]], values: dict[str, Any]) -> None:
        """Become what `state` was taken from."""
        self._optimiser.forget()
        named, moments_of_each = self.network.named_parameters(), self._optimiser.moments
        for (name, parameter), average, moments in zip(named, self._average, moments_of_each, strict=True):
            with torch.no_grad():
                parameter.copy_(torch.from_numpy(arrays[f"network.{name}"]))
                average.copy_(torch.from_numpy(arrays[f"average.{name}"]))
            moments.update(
                (key, _like(arrays[f"{key}.{name}"], parameter)) for key in MOMENTS if f"{key}.{name}" in arrays
            )
        self.steps = int(values["steps"])
        self._random = numpy_generator(values["random"])
        set_torch_state(self.network.dropout.generator, values["dropout"])


def _like(array: NDArray[Any], parameter: Tensor) -> Tensor:
    """The array as a tensor that lies in memory as the parameter does."""
    if array.shape != tuple(parameter.shape):
        return torch.tensor(array)
    return torch.empty_like(parameter).copy_(torch.from_numpy(array))
