"""The network in PyTorch, for training, and the standardisation of its input.

What the presets are made of is said in `llrp_online.architecture`; the paper's is Nava et al. 2019, section IV-E. The
network returns logits; a probability is their sigmoid, which the paper has as its last layer.

The layers written down in `Network` are the reference for its blocks, and run where there is no compiled code;
otherwise `llrp_online.blocks` takes their place.
"""

import math
from collections.abc import Mapping
from typing import cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from llrp_online.architecture import DEVIATION_FLOOR, Architecture, Outputs, PictureShape, Preset, architecture
from llrp_online.blocks import Blocks
from replay.compiling import Compiled


def build(preset: Preset, picture_shape: PictureShape, outputs: Outputs, seed: int = 0) -> "Network":
    """A new network, its weights drawn from `seed` alone; nobody else's random numbers are touched.

    Args:
        preset: `online` or `paper`.
        picture_shape: (height, width, channels), three channels for each camera.
        outputs: (targets, sensors).
        seed: of the weights and of the dropout.
    """
    return Network(architecture(preset, picture_shape[2]), picture_shape, outputs, seed)


def standardise(pictures: NDArray[np.uint8] | NDArray[np.float32]) -> Tensor:
    """Each picture minus its own mean, over its own standard deviation (section IV-D).

    All pixels and channels of a picture share one mean and one deviation, those of several cameras too, so that colours
    and the cameras' relative brightness remain.

    Args:
        pictures: (N, H, W, C) uint8, or float32 on the same scale of 0 to 255.

    Returns:
        (N, C, H, W) float32, channels_last.

    >>> standardise(np.array([[[[0, 100, 200]]]], np.uint8)).flatten()
    tensor([-1.2247,  0.0000,  1.2247])
    """
    count, height, width, channels = pictures.shape
    flat = torch.from_numpy(pictures.reshape(count, -1).astype(np.float32, order="C"))
    flat -= flat.mean(1, keepdim=True)
    deviation = torch.linalg.vector_norm(flat, dim=1, keepdim=True) / math.sqrt(flat.shape[1])
    flat /= deviation.clamp(min=DEVIATION_FLOOR)
    return flat.view(count, height, width, channels).permute(0, 3, 1, 2)


class Network(nn.Module):
    """Blocks, dropout, a dense layer, outputs.

    >>> network = build("paper", (64, 80, 3), (31, 5))
    >>> tuple(network(standardise(np.zeros((2, 64, 80, 3), np.uint8))).shape)
    (2, 31, 5)
    """

    def __init__(self, plan: Architecture, picture_shape: PictureShape, outputs: Outputs, seed: int) -> None:
        super().__init__()
        self._outputs_shape = outputs
        blocks = [(block.channels, block.kernel, block.stride) for block in plan.blocks]
        self._compiled = Compiled("llrp_online.blocks.kernels", blocks, picture_shape)
        self._blocks: Blocks | None = None
        generator = torch.Generator().manual_seed(seed)
        channels = (picture_shape[2], *(block.channels for block in plan.blocks))
        self.convolutions = nn.ModuleList(
            _Convolution(before, block.channels, block.kernel, block.stride, block.padding)
            for before, block in zip(channels, plan.blocks, strict=False)
        )
        self.dense = _Dense(plan.features(picture_shape), plan.dense)
        self.outputs = _Dense(plan.dense, outputs[0] * outputs[1])
        self.dropout = Dropout(plan.dropout, generator)
        for parameter in self.parameters():
            # Glorot's uniform weights and zero biases, the defaults of the authors' library.
            if parameter.ndim > 1:
                nn.init.xavier_uniform_(parameter, generator=generator)
            else:
                nn.init.zeros_(parameter)
            if parameter.ndim == 4:  # channels last: a training step takes a quarter less time on a CPU
                parameter.data = parameter.data.contiguous(memory_format=torch.channels_last)

    def forward(self, pictures: Tensor) -> Tensor:
        """(N, C, H, W) standardised float32, channels_last -> (N, targets, sensors) logits."""
        kernels = self._compiled.get()
        if kernels is None:
            x = self.reference(pictures)
        else:
            self._blocks = self._blocks or Blocks(kernels)
            x = self._blocks(pictures, list(self.convolutions.parameters()))
        x = functional.relu(self.dense(self.dropout(x.flatten(1))))
        return self.outputs(x).unflatten(1, self._outputs_shape)

    def reference(self, pictures: Tensor) -> Tensor:
        """What the blocks make of (N, C, H, W): (N, C', H', W')."""
        x = pictures
        for convolution in self.convolutions:
            # Pooling before the ReLU is the same function with a quarter of the work; ceil_mode pads at the far edge.
            x = functional.relu(functional.max_pool2d(convolution(x), 2, ceil_mode=True))
        return x

    def set_weights(self, weights: Mapping[str, NDArray[np.float32]]) -> None:
        """Copy in what `weights` gave; RuntimeError names what is missing, unknown or of another shape."""
        self.load_state_dict({name: torch.tensor(array) for name, array in weights.items()})

    def weights(self) -> dict[str, NDArray[np.float32]]:
        """A copy of every parameter by name, as `Architecture.parameters` lists them."""
        return {
            name: cast(NDArray[np.float32], p.detach().contiguous().numpy().copy())
            for name, p in self.named_parameters()
        }


# A layer draws its first weights from the global generator, which belongs to others: these do not, the network does.
# (Layers made on the "meta" device would not either, and cost a quarter of a second of imports.)


class _Convolution(nn.Conv2d):
    def reset_parameters(self) -> None:
        pass


class _Dense(nn.Linear):
    def reset_parameters(self) -> None:
        pass


class Dropout(nn.Module):
    """Dropout that draws from its own generator, so that no other thread can change what a run draws."""

    def __init__(self, share: float, generator: torch.Generator) -> None:
        super().__init__()
        self.share = share
        self.generator = generator

    def forward(self, x: Tensor) -> Tensor:
        """While training: zero with probability `share`, else scaled up to keep the mean. Otherwise: `x`."""
        if not self.training or self.share == 0:
            return x
        kept = torch.empty_like(x).bernoulli_(1 - self.share, generator=self.generator)
        return x * kept.mul_(1 / (1 - self.share))
