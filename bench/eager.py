"""The peer of a training step: PyTorch as its own examples use it, and augmentation a sample at a time in numpy."""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from llrp_online import losses
from llrp_online.architecture import Outputs, PictureShape
from llrp_online.augment import FULL_SCALE
from llrp_online.configuration import RobotConfiguration

Arrays = tuple[NDArray[Any], NDArray[Any], NDArray[Any]]

LUMA = np.array([0.299, 0.587, 0.114], np.float32)


def network(picture_shape: PictureShape, outputs: Outputs) -> nn.Sequential:
    """The paper's, layer by layer, for one camera."""
    height, width, channels = picture_shape
    layers: list[nn.Module] = []
    for out in (10, 10, 8):
        layers += [nn.Conv2d(channels, out, 3, padding=1), nn.ReLU(), nn.MaxPool2d(2, ceil_mode=True)]
        channels, height, width = out, -(-height // 2), -(-width // 2)
    head = [nn.Flatten(), nn.Dropout(0.2), nn.Linear(height * width * channels, 256), nn.ReLU()]
    return nn.Sequential(*layers, *head, nn.Linear(256, outputs[0] * outputs[1]))


class Step:
    """Forth, back, Adam."""

    def __init__(
        self, picture_shape: PictureShape, outputs: Outputs, memory_format: torch.memory_format, **options: Any
    ) -> None:
        torch.set_num_threads(1)
        self._network = network(picture_shape, outputs)
        self._network.to(memory_format=memory_format)  # pyright: ignore[reportCallIssue]
        self._outputs, self._memory_format = outputs, memory_format
        self._optimiser = torch.optim.Adam(self._network.parameters(), lr=1e-3, **options)

    def __call__(
        self, pictures: Tensor, labels: NDArray[np.int8], weight: NDArray[np.float32], balance: Tensor
    ) -> None:
        """Learn from standardised pictures (N, C, H, W)."""
        x = pictures.contiguous(memory_format=self._memory_format)
        logits = self._network(x).unflatten(1, self._outputs)
        loss = losses.cross_entropy(logits, torch.from_numpy(labels), torch.from_numpy(weight), balance)
        self._optimiser.zero_grad()
        torch.autograd.backward(loss)
        self._optimiser.step()


class OneByOne:
    """Augments and standardises a sample at a time: what a torch data set's `__getitem__` would do."""

    def __init__(self, robot: RobotConfiguration) -> None:
        self._settings, self._random = robot.augmentation, np.random.default_rng(0)
        mirror = robot.mirror()
        assert mirror is not None
        self._targets, self._sensors = mirror.targets, mirror.sensors

    def __call__(
        self, pictures: NDArray[np.uint8], labels: NDArray[np.int8], weight: NDArray[np.float32]
    ) -> tuple[Tensor, NDArray[np.int8], NDArray[np.float32]]:
        """(N, H, W, C) and the labels and weights of each, to (N, C, H, W) and theirs."""
        samples = [self._sample(*sample) for sample in zip(pictures, labels, weight, strict=True)]
        inputs, labels, weight = (np.stack(parts) for parts in zip(*samples, strict=True))
        return torch.from_numpy(inputs), labels, weight

    def _sample(self, raw: NDArray[np.uint8], labels: NDArray[np.int8], weight: NDArray[np.float32]) -> Arrays:
        settings, random = self._settings, self._random
        picture = raw.astype(np.float32)
        height, width, _ = picture.shape
        if random.random() < settings.flip:
            picture = picture[:, ::-1]
            labels, weight = (array[self._targets][:, self._sensors] for array in (labels, weight))
        if random.random() < settings.noise:
            noise = random.standard_normal(picture.shape, np.float32)
            picture = picture + noise * np.float32(settings.noise_deviation * FULL_SCALE)
        if random.random() < settings.grey:
            picture = np.repeat((picture @ LUMA)[..., None], 3, axis=2)
        if random.random() < settings.shadow:
            angle, depth = random.random() * 2 * np.pi, random.random() * settings.shadow_strength * FULL_SCALE
            right, down = np.cos(angle), np.sin(angle)
            plane = right * np.linspace(-0.5, 0.5, width)[None, :] + down * np.linspace(-0.5, 0.5, height)[:, None]
            picture = picture + (plane * (depth / (abs(right) + abs(down)))).astype(np.float32)[..., None]
        picture = (picture - picture.mean()) / max(picture.std(), 1.0)
        return picture.transpose(2, 0, 1), labels, weight
