"""The network's blocks on compiled kernels, as one step of PyTorch's automatic differentiation.

They give what the layers in `llrp_online.network` give, up to rounding, in a fraction of the time; how is said in
`llrp_online.convolution`. From the way forth to the way back a batch's pictures are kept in arrays that the next batch
overwrites.
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
        kernels: as `llrp_online.convolution.build` gave them.
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
        first = self._kernels[0].geometry
        expected = (first.height, first.width, first.channels)
        if pictures.shape[1:] != expected:
            raise RuntimeError(f"pictures: expected (N, {', '.join(map(str, expected))}), got {pictures.shape}")
        count = len(pictures)
        self._make_room(count)
        self.batches += 1
        self._blocks[0].picture[:count] = pictures
        following = [block.framed for block in self._blocks[1:]] + [self._out]
        for index, (block, out) in enumerate(zip(self._blocks, following, strict=True)):
            block.forward(*parameters[2 * index : 2 * index + 2], out[:count])
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
            self._out, self._out_gradient = np.zeros((2, count, self._kernels[-1].geometry.size_after), np.float32)

    def _unframed(self, out: _Floats) -> _Floats:
        """(N, H', W', out): a view of what the last block wrote, which has no frame."""
        last = self._kernels[-1].geometry
        shape = (len(out), last.pooled_rows, last.pooled_columns, last.outputs)
        return out[:, : shape[1] * last.row_after].reshape(shape)


class _Block:
    """One block's arrays for a batch: what its kernels read, write and scribble on."""

    def __init__(self, kernels: SimpleNamespace, count: int) -> None:
        self._kernels = kernels
        geometry = self._geometry = kernels.geometry
        filters, windows = geometry.kernel**2 * geometry.channels, geometry.pooled_rows * geometry.pooled_columns
        self.framed, self.gradient = np.zeros((2, count, geometry.size), np.float32)
        #: (N, H, W, C): the view of `framed` within the frame.
        self.picture = self._within_frame(self.framed)
        self._where = np.zeros((count, windows * geometry.output_lanes), np.int8)
        self._weight = np.zeros((filters, geometry.output_lanes), np.float32)
        self._bias = np.zeros(geometry.output_lanes, np.float32)
        self._turned = np.zeros((geometry.outputs, 2, geometry.kernel, geometry.seen_run), np.float32)
        self._sums = np.zeros((geometry.outputs, geometry.kernel * geometry.run), np.float32)
        self._bias_sums = np.zeros(geometry.outputs, np.float32)
        self._starts = np.zeros(geometry.listed, np.int32)
        self._factors = np.zeros(geometry.listed, np.float32)

    def forward(self, weight: _Floats, bias: _Floats, out: _Floats) -> None:
        geometry, count = self._geometry, len(out)
        self._weight[:, : geometry.outputs] = weight.reshape(geometry.outputs, -1).T
        self._bias[: geometry.outputs] = bias
        runs = weight.reshape(geometry.outputs, geometry.kernel, -1)
        for right in (0, 1):
            begin = right * geometry.stride * geometry.channels
            self._turned[:, right, :, begin : begin + runs.shape[-1]] = runs
        self._kernels.forward(self.framed[:count], self._weight, self._bias, out, self._where[:count])

    def backward(self, out_gradient: _Floats) -> tuple[_Floats, _Floats]:
        geometry, kernels, count = self._geometry, self._kernels, len(out_gradient)
        where, listed = self._where[:count], (self._starts, self._factors)
        kernels.weight_gradient(out_gradient, where, self.framed[:count], *listed, self._sums, self._bias_sums)
        if kernels.input_gradient is not None:
            kernels.input_gradient(out_gradient, where, self._turned.ravel(), *listed, self.gradient[:count])
        runs = self._sums.reshape(geometry.outputs, geometry.kernel, geometry.run)
        runs = runs[:, :, : geometry.kernel * geometry.channels]
        weight = runs.reshape(geometry.outputs, geometry.kernel, geometry.kernel, geometry.channels)
        return weight.copy(), self._bias_sums.copy()

    def _within_frame(self, framed: _Floats) -> _Floats:
        geometry, frame = self._geometry, self._geometry.frame
        rows, columns = geometry.height + 2 * frame, geometry.width + 2 * frame
        whole = framed[:, : rows * geometry.row].reshape(len(framed), rows, columns, geometry.channels)
        return whole[:, frame : frame + geometry.height, frame : frame + geometry.width]


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
