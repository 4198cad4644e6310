"""The network's blocks as compiled kernels: convolution, max-pool and ReLU in one pass, and a sparse way back.

A picture lies channels last, in a frame of zeros as wide as the convolution reaches: what a filter covers is then
`kernel` runs of `kernel * channels` numbers each, whatever the stride. Three kernels make a block:

- `forward`: the lanes of a vector are output channels. The sums of a row of pooling windows stay in registers until
  they are pooled; the full map is never stored, only each window's largest number, and where it was.
- `weight_gradient`: only that largest number has a gradient, and none if the ReLU cut it off. So about an eighth of the
  map is left, a list of patches for each output channel, and those are added up, each times its gradient.
- `input_gradient`: the same from the other side. What a window's live channels hand back is added up in registers, over
  the square of inputs that the window saw, before memory is touched.

The innermost loops are written as vectors of LLVM, because numba's own keep no such sums in registers.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import product
from types import SimpleNamespace
from typing import Any, NamedTuple

import llvmlite.binding
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from replay.compiling import jit

# Where the largest number of a window was: 0 to 3, row by row; or this, if the ReLU cut it off.
_DEAD = 4
# Cycles, at two sums a cycle, until a sum can take its next number.
_LATENCY = 8
_FLOAT, _BYTE, _OFFSET, _INDEX = ir.FloatType(), ir.IntType(8), ir.IntType(32), ir.IntType(64)


class Geometry(NamedTuple):
    """All that a block's kernels are made for: integers, which numba takes as constants.

    Attributes:
        height: rows of the input, without its frame.
        width: its columns.
        channels: its channels.
        outputs: channels of the output.
        kernel: rows and columns of a filter; odd.
        stride: of the convolution.
        frame_after: rows and columns of zeros around the output, on each side.
        lanes: numbers in a vector.
        registers: vectors that sums may stand in.
    """

    height: int
    width: int
    channels: int
    outputs: int
    kernel: int
    stride: int
    frame_after: int
    lanes: int
    registers: int

    @property
    def rows(self) -> int:
        """Of the map that is pooled."""
        return -(-self.height // self.stride)

    @property
    def columns(self) -> int:
        """Of the map that is pooled."""
        return -(-self.width // self.stride)

    @property
    def pooled_rows(self) -> int:
        """Of the output."""
        return -(-self.rows // 2)

    @property
    def pooled_columns(self) -> int:
        """Of the output."""
        return -(-self.columns // 2)

    @property
    def frame(self) -> int:
        """Zeros around the input, on each side."""
        return self.kernel // 2

    @property
    def row(self) -> int:
        """Numbers in a row of the framed input."""
        return (self.width + 2 * self.frame) * self.channels

    @property
    def row_after(self) -> int:
        """Numbers in a row of the framed output."""
        return (self.pooled_columns + 2 * self.frame_after) * self.outputs

    @property
    def size(self) -> int:
        """Numbers in a framed input, and behind it what the last vectors reach over its end."""
        rows = self.height + 2 * self.frame + self.stride
        return rows * self.row + self.stride * self.channels + self.lanes

    @property
    def size_after(self) -> int:
        """Numbers in a framed output, likewise; where another block follows, its `size` counts."""
        return (self.pooled_rows + 2 * self.frame_after) * self.row_after + self.lanes

    @property
    def output_lanes(self) -> int:
        """Output channels, rounded up to whole vectors."""
        return self.whole_vectors(self.outputs) * self.lanes

    @property
    def run(self) -> int:
        """A run under a filter, rounded up to whole vectors."""
        return self.whole_vectors(self.kernel * self.channels) * self.lanes

    @property
    def seen_run(self) -> int:
        """A row of what a window sees, rounded up to whole vectors."""
        return self.whole_vectors((self.kernel + self.stride) * self.channels) * self.lanes

    @property
    def listed(self) -> int:
        """Entries that the longest list of live places may need."""
        return max(self.pooled_rows * self.pooled_columns + _LATENCY, 2 * self.outputs + 1)

    def whole_vectors(self, numbers: int) -> int:
        """So many hold these numbers."""
        return -(-numbers // self.lanes)


def build(blocks: Sequence[tuple[int, int, int]], picture_shape: Sequence[int]) -> list[SimpleNamespace]:
    """Compile the kernels of a chain of blocks.

    Args:
        blocks: (output channels, kernel, stride) of each, from the picture inwards.
        picture_shape: (height, width, channels).

    Returns:
        For each block its `geometry` and the functions `forward`, `weight_gradient` and `input_gradient`; the first
        has no `input_gradient`, for a picture does not learn.
    """
    lanes, registers = _vector_unit()
    height, width, channels = picture_shape
    found: list[SimpleNamespace] = []
    for index, (outputs, kernel, stride) in enumerate(blocks):
        frame_after = blocks[index + 1][1] // 2 if index + 1 < len(blocks) else 0
        geometry = Geometry(height, width, channels, outputs, kernel, stride, frame_after, lanes, registers)
        found.append(
            SimpleNamespace(
                geometry=geometry,
                forward=_forward(geometry),
                weight_gradient=_weight_gradient(geometry),
                input_gradient=_input_gradient(geometry) if index else None,
            )
        )
        height, width, channels = geometry.pooled_rows, geometry.pooled_columns, outputs
    return found


def _vector_unit() -> tuple[int, int]:
    """This processor's: floats in a vector, and registers for sums, some being left for factors."""
    features: dict[str, bool] = llvmlite.binding.get_host_cpu_features()
    if features.get("avx512f"):
        return 16, 24
    if features.get("avx2"):
        return 8, 12
    return 4, 24 if features.get("neon") else 12


# --- the kernels: loops over pictures and windows


def _forward(geometry: Geometry) -> Callable[..., None]:
    g = geometry
    shape = tuple(g)
    pairs, single_row = divmod(g.rows, 2)
    # As many windows side by side as registers hold, and no fewer in the last tile of a row than can be helped.
    most = max(g.registers // (4 * g.whole_vectors(g.outputs)), 1)
    windows = -(-g.pooled_columns // -(-g.pooled_columns // most))
    tiles = g.columns // (2 * windows)
    rest = g.columns - 2 * windows * tiles
    across, down = 2 * windows * g.stride * g.channels, 2 * g.stride * g.row
    across_after, down_after = windows * g.outputs, g.row_after
    first_after = g.frame_after * (g.row_after + g.outputs)
    across_where, down_where = windows * g.output_lanes, g.pooled_columns * g.output_lanes
    two_rows, two_rows_rest, one_row, one_row_rest = (2, 2 * windows), (2, rest), (1, 2 * windows), (1, rest)

    @jit("void(f4[:, ::1], f4[:, ::1], f4[::1], f4[:, ::1], i1[:, ::1])", boundscheck=False)
    def forward(pictures: Any, weights: Any, bias: Any, out: Any, where: Any) -> None:
        for n in range(pictures.shape[0]):
            for y in range(pairs + single_row):
                at = n * pictures.shape[1] + y * down
                after = n * out.shape[1] + first_after + y * down_after
                mark = n * where.shape[1] + y * down_where
                if y < pairs:
                    for _ in range(tiles):
                        _pool_tile(shape, two_rows, pictures, at, weights, bias, out, after, where, mark)
                        at, after, mark = at + across, after + across_after, mark + across_where
                    if rest:
                        _pool_tile(shape, two_rows_rest, pictures, at, weights, bias, out, after, where, mark)
                if single_row and y == pairs:
                    for _ in range(tiles):
                        _pool_tile(shape, one_row, pictures, at, weights, bias, out, after, where, mark)
                        at, after, mark = at + across, after + across_after, mark + across_where
                    if rest:
                        _pool_tile(shape, one_row_rest, pictures, at, weights, bias, out, after, where, mark)

    return forward


def _weight_gradient(geometry: Geometry) -> Callable[..., None]:
    shape, outputs = tuple(geometry), geometry.outputs

    @jit("void(f4[:, ::1], i1[:, ::1], f4[:, ::1], i4[::1], f4[::1], f4[:, ::1], f4[::1])", boundscheck=False, fastmath={"reassoc", "nsz"})
    def weight_gradient(
        gradient: Any, where: Any, pictures: Any, starts: Any, factors: Any, sums: Any, bias_sums: Any
    ) -> None:
        sums[:] = 0
        bias_sums[:] = 0
        for n in range(pictures.shape[0]):
            picture, after, mark = n * pictures.shape[1], n * gradient.shape[1], n * where.shape[1]
            for channel in range(outputs):
                live = _list_places(shape, gradient, after + channel, where, mark + channel, starts, factors)
                total = bias_sums[channel]
                for index in range(live):
                    total += factors[index]
                bias_sums[channel] = total
                _add_patches(shape, pictures, picture, starts, factors, live, sums, channel)

    return weight_gradient


def _input_gradient(geometry: Geometry) -> Callable[..., None]:
    g = geometry
    shape = tuple(g)
    rows, columns, first_after = g.pooled_rows, g.pooled_columns, g.frame_after * (g.row_after + g.outputs)
    down, across, down_after, across_after = 2 * g.stride * g.row, 2 * g.stride * g.channels, g.row_after, g.outputs
    down_where, across_where = g.pooled_columns * g.output_lanes, g.output_lanes

    @jit("void(f4[:, ::1], i1[:, ::1], f4[::1], i4[::1], f4[::1], f4[:, ::1])", boundscheck=False)
    def input_gradient(gradient: Any, where: Any, filters: Any, starts: Any, factors: Any, out: Any) -> None:
        for n in range(out.shape[0]):
            out[n] = 0
            for y in range(rows):
                after = n * gradient.shape[1] + first_after + y * down_after
                mark = n * where.shape[1] + y * down_where
                seen = n * out.shape[1] + y * down
                for _ in range(columns):
                    _add_window(shape, gradient, after, where, mark, filters, starts, factors, out, seen)
                    after, mark, seen = after + across_after, mark + across_where, seen + across

    return input_gradient


# --- their innermost loops: vectors, which LLVM keeps in registers


class _Vectors:
    """Writes vector code."""

    def __init__(self, builder: Any, lanes: int) -> None:
        self.builder = builder
        self.lanes = lanes
        self.type = ir.VectorType(_FLOAT, lanes)
        self.zero = ir.Constant(self.type, [0.0] * lanes)
        signature = ir.FunctionType(self.type, [self.type] * 3)
        name = f"llvm.fmuladd.v{lanes}f32"
        self._multiply_add = cgutils.get_or_insert_function(builder.module, signature, name)

    def at(self, pointer: Any, offset: Any) -> Any:
        """The pointer, so many elements on."""
        return self.builder.gep(pointer, [_INDEX(offset) if isinstance(offset, int) else offset])

    def load(self, pointer: Any, offset: Any) -> Any:
        """Consecutive numbers, aligned or not."""
        return self.builder.load(self.builder.bitcast(self.at(pointer, offset), self.type.as_pointer()), align=4)

    def store(self, vector: Any, pointer: Any, offset: Any) -> None:
        """To consecutive numbers or bytes, aligned or not."""
        target = self.builder.bitcast(self.at(pointer, offset), vector.type.as_pointer())
        self.builder.store(vector, target, align=vector.type.element.width // 8 if vector.type.element == _BYTE else 4)

    def everywhere(self, pointer: Any, offset: Any) -> Any:
        """One number in every lane."""
        number = self.builder.load(self.at(pointer, offset))
        first = self.builder.insert_element(ir.Constant(self.type, ir.Undefined), number, ir.IntType(32)(0))
        lanes = ir.Constant(ir.VectorType(ir.IntType(32), self.lanes), [0] * self.lanes)
        return self.builder.shuffle_vector(first, ir.Constant(self.type, ir.Undefined), lanes)

    def variable(self, value: Any) -> Any:
        """A vector that changes, in a register."""
        variable = cgutils.alloca_once(self.builder, self.type)
        self.builder.store(value, variable)
        return variable

    def counter(self) -> Any:
        """An integer that changes, in a register; zero."""
        return cgutils.alloca_once_value(self.builder, _INDEX(0))

    def sum(self, *products: tuple[Any, int]) -> Any:
        """Of integers times constants."""
        total: Any = _INDEX(0)
        for value, factor in products:
            total = self.builder.add(total, self.builder.mul(value, _INDEX(factor)))
        return total

    def add_to(self, pointer: Any, offset: int, variable: Any) -> None:
        """Add a variable to consecutive numbers in memory."""
        total = self.builder.fadd(self.load(pointer, offset), self.builder.load(variable))
        self.store(total, pointer, offset)

    def accumulate(self, variable: Any, a: Any, b: Any) -> None:
        """variable += a * b, lane by lane."""
        total = self.builder.call(self._multiply_add, [a, b, self.builder.load(variable)])
        self.builder.store(total, variable)

    @contextmanager
    def loop(self, count: Any) -> Iterator[Any]:
        """Yields the index."""
        count = _INDEX(count) if isinstance(count, int) else count
        with cgutils.for_range(self.builder, count, intp=_INDEX) as loop:
            yield loop.index


def _vector_code(arguments: Sequence[Any], write: Callable[..., Any], returned: Any = types.void) -> Any:
    """What an intrinsic returns: its signature, and how `write` gets its vectors, its constants and its arguments.

    The first argument is a `Geometry`; tuples of constants stay tuples, arrays become pointers, the others integers.
    """
    kinds = [kind if isinstance(kind, types.BaseTuple | types.Array) else types.intp for kind in arguments]

    def code(context: Any, builder: Any, signature: Any, values: Sequence[Any]) -> Any:
        given: list[Any] = []
        for kind, value in zip(signature.args, values, strict=True):
            if isinstance(kind, types.BaseTuple):
                given.append(tuple(constant.literal_value for constant in kind))
            elif isinstance(kind, types.Array):
                given.append(context.make_array(kind)(context, builder, value).data)
            else:
                given.append(value)
        geometry = Geometry(*given[0])
        value = write(_Vectors(builder, geometry.lanes), geometry, *given[1:])
        return context.get_dummy_value() if value is None else value

    return returned(*kinds), code


@intrinsic(prefer_literal=True)
def _pool_tile(_, shape, tile, pictures, at, weights, bias, out, after, where, mark):
    return _vector_code((shape, tile, pictures, at, weights, bias, out, after, where, mark), _write_pool_tile)


@intrinsic(prefer_literal=True)
def _list_places(_, shape, gradient, after, where, mark, starts, factors):
    return _vector_code((shape, gradient, after, where, mark, starts, factors), _write_list_places, types.intp)


@intrinsic(prefer_literal=True)
def _add_patches(_, shape, pictures, at, starts, factors, count, sums, channel):
    return _vector_code((shape, pictures, at, starts, factors, count, sums, channel), _write_add_patches)


@intrinsic(prefer_literal=True)
def _add_window(_, shape, gradient, after, where, mark, filters, starts, factors, out, at):
    return _vector_code((shape, gradient, after, where, mark, filters, starts, factors, out, at), _write_add_window)


def _write_pool_tile(
    v: _Vectors,
    g: Geometry,
    tile: tuple[int, int],
    pictures: Any,
    at: Any,
    weights: Any,
    bias: Any,
    out: Any,
    after: Any,
    where: Any,
    mark: Any,
) -> None:
    rows, columns = tile
    pictures, out, where = v.at(pictures, at), v.at(out, after), v.at(where, mark)
    parts = range(g.whole_vectors(g.outputs))
    sums = {
        (y, x, part): v.variable(v.load(bias, part * g.lanes))
        for y, x, part in product(range(rows), range(columns), parts)
    }
    run = g.kernel * g.channels
    with v.loop(g.kernel) as filter_row:
        picture_row = v.at(pictures, v.builder.mul(filter_row, _INDEX(g.row)))
        weight_row = v.at(weights, v.builder.mul(filter_row, _INDEX(run * g.output_lanes)))
        with v.loop(run) as index:
            picture = v.at(picture_row, index)
            weight = v.at(weight_row, v.builder.mul(index, _INDEX(g.output_lanes)))
            loaded = [v.load(weight, part * g.lanes) for part in parts]
            for y, x in product(range(rows), range(columns)):
                number = v.everywhere(picture, y * g.stride * g.row + x * g.stride * g.channels)
                for part in parts:
                    v.accumulate(sums[y, x, part], number, loaded[part])
    for window, part in product(range((columns + 1) // 2), parts):
        places = [(y, x) for y in range(rows) for x in (2 * window, 2 * window + 1) if x < columns]
        candidates = [(2 * y + x % 2, v.builder.load(sums[y, x, part])) for y, x in places]
        largest, place = _largest(v, candidates)
        v.store(largest, out, window * g.outputs + part * g.lanes)
        v.store(place, where, window * g.output_lanes + part * g.lanes)


def _largest(v: _Vectors, candidates: Sequence[tuple[int, Any]]) -> tuple[Any, Any]:
    """Lane by lane the largest number, or zero, and its place, the first of equals; a NaN goes through the ReLU."""

    def places(place: int) -> Any:
        return ir.Constant(ir.VectorType(_BYTE, v.lanes), [place] * v.lanes)

    place, largest = candidates[0]
    where = places(place)
    for place, candidate in candidates[1:]:
        larger = v.builder.fcmp_ordered(">", candidate, largest)
        largest = v.builder.select(larger, candidate, largest)
        where = v.builder.select(larger, places(place), where)
    cut = v.builder.fcmp_ordered("<=", largest, v.zero)
    return v.builder.select(cut, v.zero, largest), v.builder.select(cut, places(_DEAD), where)


def _write_list_places(
    v: _Vectors, g: Geometry, gradient: Any, after: Any, where: Any, mark: Any, starts: Any, factors: Any
) -> Any:
    """List one channel's live places: where its patch starts in a picture, and its gradient; returns their number."""
    b = v.builder
    gradient, where, count = v.at(gradient, after), v.at(where, mark), v.counter()
    with v.loop(g.pooled_rows) as y, v.loop(g.pooled_columns) as x:
        place = b.zext(b.load(v.at(where, v.sum((y, g.pooled_columns * g.output_lanes), (x, g.output_lanes)))), _INDEX)
        row, column = b.add(y, _INDEX(g.frame_after)), b.add(x, _INDEX(g.frame_after))
        factor = b.load(v.at(gradient, v.sum((row, g.row_after), (column, g.outputs))))
        lower, right = b.lshr(place, _INDEX(1)), b.and_(place, _INDEX(1))
        step_y, step_x = g.stride * g.row, g.stride * g.channels
        start = v.sum((y, 2 * step_y), (x, 2 * step_x), (lower, step_y), (right, step_x))
        # Written always, kept if live: a branch would be guessed wrong half of the time.
        index = b.load(count)
        b.store(b.trunc(start, _OFFSET), v.at(starts, index))
        b.store(factor, v.at(factors, index))
        b.store(b.add(index, b.zext(b.icmp_unsigned("!=", place, _INDEX(_DEAD)), _INDEX)), count)
    return b.load(count)


def _write_add_patches(
    v: _Vectors, g: Geometry, pictures: Any, at: Any, starts: Any, factors: Any, count: Any, sums: Any, channel: Any
) -> None:
    """Add the patches of a list to a channel's sums, each times its factor."""
    b = v.builder
    pictures, sums = v.at(pictures, at), v.at(sums, b.mul(channel, _INDEX(g.kernel * g.run)))
    for chosen in _portions(list(product(range(g.kernel), range(0, g.run, g.lanes))), g.registers):
        # A sum takes its next number only some cycles later: where sums are few, patches take turns at several.
        turns = range(-(-_LATENCY // len(chosen)))
        totals = {(turn, *piece): v.variable(v.zero) for turn in turns for piece in chosen}
        for turn in turns[1:]:
            b.store(_FLOAT(0.0), v.at(factors, b.add(count, _INDEX(turn - 1))))
            b.store(_OFFSET(0), v.at(starts, b.add(count, _INDEX(turn - 1))))
        with v.loop(b.udiv(b.add(count, _INDEX(len(turns) - 1)), _INDEX(len(turns)))) as index:
            first = b.mul(index, _INDEX(len(turns)))
            for turn in turns:
                factor = v.everywhere(v.at(factors, first), turn)
                patch = v.at(pictures, b.sext(b.load(v.at(v.at(starts, first), turn)), _INDEX))
                for y, x in chosen:
                    v.accumulate(totals[turn, y, x], factor, v.load(patch, y * g.row + x))
        for y, x in chosen:
            for turn in turns:
                v.add_to(sums, y * g.run + x, totals[turn, y, x])


def _write_add_window(
    v: _Vectors,
    g: Geometry,
    gradient: Any,
    after: Any,
    where: Any,
    mark: Any,
    filters: Any,
    starts: Any,
    factors: Any,
    out: Any,
    at: Any,
) -> None:
    """Hand a window's gradient back to the inputs it saw."""
    b = v.builder
    gradient, where, out = v.at(gradient, after), v.at(where, mark), v.at(out, at)
    # Two lists, of the places in the window's upper and in its lower row, so that each touches its own rows only.
    counts = [v.counter(), v.counter()]
    with v.loop(g.outputs) as channel:
        place = b.zext(b.load(v.at(where, channel)), _INDEX)
        factor = b.load(v.at(gradient, channel))
        filter_ = b.add(b.mul(channel, _INDEX(2)), b.and_(place, _INDEX(1)))
        start = b.trunc(b.mul(filter_, _INDEX(g.kernel * g.seen_run)), _OFFSET)
        for half, count in enumerate(counts):
            index = b.load(count)
            b.store(start, v.at(v.at(starts, half * g.outputs), index))
            b.store(factor, v.at(v.at(factors, half * g.outputs), index))
            here = b.icmp_unsigned("==", b.lshr(place, _INDEX(1)), _INDEX(half))
            b.store(b.add(index, b.zext(here, _INDEX)), count)
    rows = g.kernel + g.stride
    for chosen in _portions(range(0, g.seen_run, g.lanes), max(g.registers // rows, 1)):
        totals = {(y, x): v.variable(v.zero) for y in range(rows) for x in chosen}
        for half, count in enumerate(counts):
            with v.loop(b.load(count)) as index:
                factor = v.everywhere(v.at(factors, half * g.outputs), index)
                start = b.sext(b.load(v.at(v.at(starts, half * g.outputs), index)), _INDEX)
                for y, x in product(range(g.kernel), chosen):
                    weight = v.load(v.at(filters, start), y * g.seen_run + x)
                    v.accumulate(totals[y + half * g.stride, x], factor, weight)
        for y, x in product(range(rows), chosen):
            v.add_to(out, y * g.row + x, totals[y, x])


def _portions(pieces: Sequence[Any], most: int) -> list[Sequence[Any]]:
    """Cut into equal portions of at most so many."""
    portions = -(-len(pieces) // most)
    size = -(-len(pieces) // portions)
    return [pieces[first : first + size] for first in range(0, len(pieces), size)]
