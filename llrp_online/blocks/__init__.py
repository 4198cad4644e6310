"""The network's blocks on compiled kernels, as one step of PyTorch's automatic differentiation.

They give what the layers in `llrp_online.network` give, up to rounding, in a fraction of the time: `kernels` says how.
From the way forth to the way back a batch's pictures are kept in arrays that the next batch overwrites.
"""

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

_Floats = NDArray[np.float32]


class Blocks:
    """A chain of blocks, and what it remembers of the newest batch.

    Args:
        kernels: as `llrp_online.blocks.kernels.build` gave them.
    """

    def __init__(self, kernels: Sequence[SimpleNamespace]) -> None:
        self._kernels = kernels
        self._room = 0
        self.batches = 0

    def __call__(self, pictures: Tensor, parameters: Sequence[Tensor]) -> Tensor:
        """What the last block hands on. Its gradient reaches the parameters, and never the pictures.

        Args:
            pictures: (N, C, H, W) float32, best channels_last; RuntimeError if not of the size compiled for.
            parameters: each block's weight (out, in, rows, columns) and bias (out,), in turn.

        Returns:
            (N, out, H', W') float32, channels_last.
        """
        return _Step.apply(self, pictures, *parameters)  # pyright: ignore[reportReturnType]

    def forward(self, pictures: _Floats, parameters: Sequence[_Floats]) -> _Floats:
        """The same in arrays that are channels last: (N, H, W, C), weights (out, rows, columns, in)."""
        first = self._kernels[0].shape
        expected = (first.height, first.width, first.channels)
        if pictures.shape[1:] != expected:
            raise RuntimeError(f"pictures: expected (N, {', '.join(map(str, expected))}), got {pictures.shape}")
        count = len(pictures)
        self._make_room(count)
        self.batches += 1
        self._blocks[0].picture[:count] = pictures
        following = [block.framed for block in self._blocks[1:]] + [self._out]
        for index, (block, out) in enumerate(zip(self._blocks, following, strict=True)):
            block.forward(parameters[2 * index], parameters[2 * index + 1], out[:count])
        return self._unframed(self._out[:count]).copy()

    def backward(self, gradient: _Floats) -> list[_Floats]:
        """From the gradient at what `forward` returned to that at each parameter, for the newest batch."""
        count = len(gradient)
        self._unframed(self._out_gradient)[:count] = gradient
        found: list[_Floats] = []
        following = [block.gradient for block in self._blocks[1:]] + [self._out_gradient]
        for block, out_gradient in zip(reversed(self._blocks), reversed(following), strict=True):
            found = [*block.backward(out_gradient[:count]), *found]
        return found

    def _make_room(self, count: int) -> None:
        if count > self._room:
            self._room = count
            self._blocks = [_Block(kernels, count) for kernels in self._kernels]
            self._out, self._out_gradient = np.zeros((2, count, self._kernels[-1].shape.size_after), np.float32)

    def _unframed(self, out: _Floats) -> _Floats:
        """(N, H', W', out): a view of what the last block wrote, which has no frame."""
        last = self._kernels[-1].shape
        sizes = (len(out), last.pooled_rows, last.pooled_columns, last.outputs)
        return out[:, : sizes[1] * last.row_after].reshape(sizes)


class _Block:
    """One block's arrays for a batch: what its kernels read, write and scribble on."""

    def __init__(self, kernels: SimpleNamespace, count: int) -> None:
        self._kernels = kernels
        shape = self._shape = kernels.shape
        filters, windows = shape.kernel**2 * shape.channels, shape.pooled_rows * shape.pooled_columns
        self.framed, self.gradient = np.zeros((2, count, shape.size), np.float32)
        #: (N, H, W, C): the view of `framed` within the frame.
        self.picture = self._within_frame(self.framed)
        self._where = np.zeros((count, windows * shape.output_run), np.int8)
        self._weight = np.zeros((filters, shape.output_run), np.float32)
        self._bias = np.zeros(shape.output_run, np.float32)
        self._turned = np.zeros((shape.outputs, 2, shape.kernel, shape.seen_run), np.float32)
        self._sums = np.zeros((shape.outputs, shape.kernel * shape.run), np.float32)
        self._bias_sums = np.zeros(shape.outputs, np.float32)
        self._starts = np.zeros(shape.listed, np.int32)
        self._factors = np.zeros(shape.listed, np.float32)

    def forward(self, weight: _Floats, bias: _Floats, out: _Floats) -> None:
        shape, count = self._shape, len(out)
        self._weight[:, : shape.outputs] = weight.reshape(shape.outputs, -1).T
        self._bias[: shape.outputs] = bias
        runs = weight.reshape(shape.outputs, shape.kernel, -1)
        for right in (0, 1):
            begin = right * shape.stride * shape.channels
            self._turned[:, right, :, begin : begin + runs.shape[-1]] = runs
        self._kernels.forward(self.framed[:count], self._weight, self._bias, out, self._where[:count])

    def backward(self, out_gradient: _Floats) -> tuple[_Floats, _Floats]:
        shape, kernels, count = self._shape, self._kernels, len(out_gradient)
        where, listed = self._where[:count], (self._starts, self._factors)
        kernels.weight_gradient(out_gradient, where, self.framed[:count], *listed, self._sums, self._bias_sums)
        if kernels.input_gradient is not None:
            kernels.input_gradient(out_gradient, where, self._turned.ravel(), *listed, self.gradient[:count])
        runs = self._sums.reshape(shape.outputs, shape.kernel, shape.run)
        runs = runs[:, :, : shape.kernel * shape.channels]
        weight = runs.reshape(shape.outputs, shape.kernel, shape.kernel, shape.channels)
        return weight.copy(), self._bias_sums.copy()

    def _within_frame(self, framed: _Floats) -> _Floats:
        shape, frame = self._shape, self._shape.frame
        rows, columns = shape.height + 2 * frame, shape.width + 2 * frame
        whole = framed[:, : rows * shape.row].reshape(len(framed), rows, columns, shape.channels)
        return whole[:, frame : frame + shape.height, frame : frame + shape.width]


class _Step(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, blocks: Blocks, pictures: Tensor, *parameters: Tensor) -> Tensor:  # pyright: ignore[reportIncompatibleMethodOverride]
        out = blocks.forward(_channels_last(pictures), [_channels_last(parameter) for parameter in parameters])
        ctx.blocks, ctx.batch = blocks, blocks.batches
        return torch.from_numpy(out).permute(0, 3, 1, 2)

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> Any:  # pyright: ignore[reportIncompatibleMethodOverride]
        if ctx.batch != ctx.blocks.batches:
            raise RuntimeError("the blocks have seen another batch since: go back before the network is used again")
        found = ctx.blocks.backward(_channels_last(gradient))
        tensors = [torch.from_numpy(array) for array in found]
        return None, None, *(tensor.permute(0, 3, 1, 2) if tensor.ndim == 4 else tensor for tensor in tensors)


def _channels_last(tensor: Tensor) -> _Floats:
    """What four dimensions there are become (N, H, W, C), in C order; without copying if it lies so."""
    moved = tensor.detach().permute(0, 2, 3, 1) if tensor.ndim == 4 else tensor.detach()
    return moved.contiguous().numpy()
