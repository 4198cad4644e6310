"""What each preset of the network is made of, said once for all who build it: PyTorch to train, ONNX to infer.

A network is a chain of blocks (convolution, ReLU, max-pool), one dense layer and the outputs: one logit for each target
and sensor. `paper` is Nava et al. 2019, section IV-E and figure 5; its form for several cameras, stacked along the
channels, is the one its authors gave the Pioneer.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Preset = Literal["online", "paper"]
PictureShape = tuple[int, int, int]
Outputs = tuple[int, int]
#: By the names of `Architecture.parameters`, of the shapes there.
Weights = dict[str, NDArray[np.float32]]

# A picture flatter than one grey level is a covered lens: dividing by less would only blow up the camera's noise.
DEVIATION_FLOOR = 1.0


@dataclass(frozen=True)
class Block:
    """A convolution, a ReLU, and a max-pool of 2 with stride 2.

    Both are padded such that n rows become ceil(n / stride), then ceil of the half: nothing at the edge is dropped.
    """

    channels: int
    kernel: int = 3
    stride: int = 1

    @property
    def padding(self) -> int:
        """Zeros around the convolution's input, on each side."""
        return self.kernel // 2

    def size_after(self, size: int) -> int:
        """Rows (or columns) that leave the block when `size` enter."""
        convolved = math.ceil(size / self.stride)
        return math.ceil(convolved / 2)


@dataclass(frozen=True)
class Architecture:
    """A preset.

    Attributes:
        blocks: from the picture inwards.
        dropout: share of the last block's outputs dropped while training.
        dense: width of the dense layer.

    >>> [block.channels for block in architecture("paper", 3).blocks]
    [10, 10, 8]
    """

    blocks: tuple[Block, ...]
    dropout: float
    dense: int

    def features(self, picture_shape: PictureShape) -> int:
        """How many numbers the last block hands to the dense layer, for pictures of (height, width, channels)."""
        height, width, _ = picture_shape
        for block in self.blocks:
            height, width = block.size_after(height), block.size_after(width)
        return height * width * self.blocks[-1].channels

    def parameters(self, picture_shape: PictureShape, outputs: Outputs) -> dict[str, tuple[int, ...]]:
        """Name and shape of every parameter, in order.

        Convolutions are (out, in, rows, columns), dense layers (out, in), as PyTorch and ONNX both have them.
        """
        shapes: dict[str, tuple[int, ...]] = {}
        channels = picture_shape[2]
        for index, block in enumerate(self.blocks):
            shapes[f"convolutions.{index}.weight"] = (block.channels, channels, block.kernel, block.kernel)
            shapes[f"convolutions.{index}.bias"] = (block.channels,)
            channels = block.channels
        labels = outputs[0] * outputs[1]
        shapes["dense.weight"] = (self.dense, self.features(picture_shape))
        shapes["dense.bias"] = (self.dense,)
        shapes["outputs.weight"] = (labels, self.dense)
        shapes["outputs.bias"] = (labels,)
        return shapes


_PAPER = Architecture((Block(10), Block(10), Block(8)), dropout=0.2, dense=256)
_PAPER_SEVERAL_CAMERAS = Architecture((Block(20), Block(12), Block(10), Block(8)), dropout=0.0, dense=512)
# Widths are multiples of 16, which fill the processor's vectors; the stem's stride quarters what comes after it.
# A training step takes nine tenths of the paper network's time, compiled, and six tenths in plain PyTorch (batch of 64,
# 80x64 pictures, one thread); what it predicts after a drive is better: `bench/test_preset.py` measures both.
# It learns by heart what little it has seen: so much dropout keeps it from that (`llrp experiment ablate`).
_ONLINE = Architecture((Block(16, kernel=5, stride=2), Block(32), Block(32)), dropout=0.7, dense=256)


def architecture(preset: Preset, channels: int) -> Architecture:
    """The preset for pictures of so many channels, three for each camera; ValueError if there is none."""
    if channels < 3 or channels % 3:
        raise ValueError(f"picture channels: expected 3 for each camera, got {channels}")
    if preset == "paper":
        return _PAPER if channels == 3 else _PAPER_SEVERAL_CAMERAS
    if preset == "online":
        return _ONLINE
    raise ValueError(f"network preset: expected 'online' or 'paper', got {preset!r}")
