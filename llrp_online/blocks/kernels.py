"""A block's kernels: convolution, max-pool and ReLU in one pass, and a sparse way back.

- `forward`: the lanes of a vector are output channels. The sums of a row of pooling windows stay in registers until
  they are pooled; the full map is never stored, only each window's largest number, and where it was.
- `weight_gradient`: only that largest number has a gradient, and none if the ReLU cut it off. So about an eighth of the
  map is left, a list of patches for each output channel, and those are added up, each times its gradient.
- `input_gradient`: the same from the other side. What a window's live channels hand back is added up in registers, over
  the square of inputs that the window saw, before memory is touched.
"""

import zlib
from collections.abc import Callable, Sequence
from itertools import product
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import llvmlite.binding
from llvmlite import ir

from llrp_online.blocks import shape as shapes
from llrp_online.blocks import vectors
from llrp_online.blocks.shape import LATENCY, Shape
from llrp_online.blocks.vectors import BYTE, FLOAT, INDEX, OFFSET, Vectors, vector_code
from replay.compiling import jit

# Where the largest number of a window was: 0 to 3, row by row; or this, if the ReLU cut it off.
_DEAD = 4


def build(blocks: Sequence[tuple[int, int, int]], picture_shape: Sequence[int]) -> list[SimpleNamespace]:
    """Compile the kernels of a chain of blocks.

    Args:
        blocks: (output channels, kernel, stride) of each, from the picture inwards.
        picture_shape: (height, width, channels).

    Returns:
        For each block its `shape` and the functions `forward`, `weight_gradient` and `input_gradient`; the first
        has no `input_gradient`, for a picture does not learn.
    """
    lanes, registers = _vector_unit()
    written_by = _digest(shapes.__file__, vectors.__file__)
    height, width, channels = picture_shape
    found: list[SimpleNamespace] = []
    for index, (outputs, kernel, stride) in enumerate(blocks):
        frame_after = blocks[index + 1][1] // 2 if index + 1 < len(blocks) else 0
        shape = Shape(height, width, channels, outputs, kernel, stride, frame_after, lanes, registers, written_by)
        found.append(
            SimpleNamespace(
                shape=shape,
                forward=_forward(shape),
                weight_gradient=_weight_gradient(shape),
                input_gradient=_input_gradient(shape) if index else None,
            )
        )
        height, width, channels = shape.pooled_rows, shape.pooled_columns, outputs
    return found


def _digest(*files: str) -> int:
    """Of what is in them."""
    return zlib.crc32(b"".join(Path(file).read_bytes() for file in files))


def _vector_unit() -> tuple[int, int]:
    """This processor's: floats in a vector, and registers for sums, some being left for factors."""
    features: dict[str, bool] = llvmlite.binding.get_host_cpu_features()
    if features.get("avx512f"):
        return 16, 24
    if features.get("avx2"):
        return 8, 12
    return 4, 24 if features.get("neon") else 12


# --- the kernels: loops over pictures and windows


def _forward(s: Shape) -> Callable[..., None]:
    constants = tuple(s)
    pairs, single_row = divmod(s.rows, 2)
    # As many windows side by side as registers hold, in tiles of equal width.
    tiles = -(-s.pooled_columns // max(s.registers // (4 * s.output_vectors), 1))
    columns = 2 * -(-s.pooled_columns // tiles)
    tiles, rest = divmod(s.columns, columns)
    across, down = columns * s.stride * s.channels, 2 * s.stride * s.row
    across_after, down_after, first_after = columns // 2 * s.outputs, s.row_after, s.first_after
    across_where, down_where = columns // 2 * s.output_run, s.pooled_columns * s.output_run
    two_rows, two_rows_rest, one_row, one_row_rest = (2, columns), (2, rest), (1, columns), (1, rest)

    @jit("void(f4[:, ::1], f4[:, ::1], f4[::1], f4[:, ::1], i1[:, ::1])", boundscheck=False)
    def forward(pictures: Any, weights: Any, bias: Any, out: Any, where: Any) -> None:
        for n in range(pictures.shape[0]):
            for y in range(pairs + single_row):
                at = n * pictures.shape[1] + y * down
                after = n * out.shape[1] + first_after + y * down_after
                mark = n * where.shape[1] + y * down_where
                for _ in range(tiles):
                    if y < pairs:
                        _pool_tile(constants, two_rows, (pictures, at), weights, bias, (out, after), (where, mark))
                    elif single_row:
                        _pool_tile(constants, one_row, (pictures, at), weights, bias, (out, after), (where, mark))
                    at, after, mark = at + across, after + across_after, mark + across_where
                if rest:
                    if y < pairs:
                        _pool_tile(constants, two_rows_rest, (pictures, at), weights, bias, (out, after), (where, mark))
                    elif single_row:
                        _pool_tile(constants, one_row_rest, (pictures, at), weights, bias, (out, after), (where, mark))

    return forward


def _weight_gradient(s: Shape) -> Callable[..., None]:
    constants, outputs, first_after = tuple(s), s.outputs, s.first_after
    size = s.kernel * s.run

    @jit(
        "void(f4[:, ::1], i1[:, ::1], f4[:, ::1], i4[::1], f4[::1], f4[:, ::1], f4[::1])",
        boundscheck=False,
        fastmath={"reassoc", "nsz"},  # the bias' sum in several parts at once
    )
    def weight_gradient(
        gradient: Any, where: Any, pictures: Any, starts: Any, factors: Any, sums: Any, bias_sums: Any
    ) -> None:
        sums[:] = 0
        bias_sums[:] = 0
        for n in range(pictures.shape[0]):
            after, mark, at = n * gradient.shape[1] + first_after, n * where.shape[1], n * pictures.shape[1]
            for channel in range(outputs):
                live = _list_places(constants, (gradient, after + channel), (where, mark + channel), starts, factors)
                total = bias_sums[channel]
                for index in range(live):
                    total += factors[index]
                bias_sums[channel] = total
                _add_patches(constants, (pictures, at), starts, factors, live, (sums, channel * size))

    return weight_gradient


def _input_gradient(s: Shape) -> Callable[..., None]:
    constants, rows, columns, first_after = tuple(s), s.pooled_rows, s.pooled_columns, s.first_after
    down, across = 2 * s.stride * s.row, 2 * s.stride * s.channels
    down_after, across_after = s.row_after, s.outputs
    down_where, across_where = s.pooled_columns * s.output_run, s.output_run

    @jit("void(f4[:, ::1], i1[:, ::1], f4[::1], i4[::1], f4[::1], f4[:, ::1])", boundscheck=False)
    def input_gradient(gradient: Any, where: Any, filters: Any, starts: Any, factors: Any, out: Any) -> None:
        for n in range(out.shape[0]):
            out[n] = 0
            for y in range(rows):
                after = n * gradient.shape[1] + first_after + y * down_after
                mark = n * where.shape[1] + y * down_where
                seen = n * out.shape[1] + y * down
                for _ in range(columns):
                    _add_window(constants, (gradient, after), (where, mark), filters, starts, factors, (out, seen))
                    after, mark, seen = after + across_after, mark + across_where, seen + across

    return input_gradient


# --- their innermost loops, written as vectors


@vector_code
def _pool_tile(
    v: Vectors, s: Shape, tile: tuple[int, int], pictures: Any, weights: Any, bias: Any, out: Any, where: Any
) -> None:
    """Sum up, pool and cut a row of windows; `tile` is how many (rows, columns) of the map they lie in."""
    v = Vectors(v.builder, s.output_lanes)
    rows, columns = tile
    parts = range(0, s.output_run, s.output_lanes)
    sums = {(y, x, part): v.variable(v.load(bias, part)) for y, x, part in product(range(rows), range(columns), parts)}
    run = s.kernel * s.channels
    with v.loop(s.kernel) as filter_row, v.loop(run) as index:
        picture = v.at(pictures, v.index((filter_row, s.row), (index, 1)))
        weight = v.at(weights, v.index((filter_row, run * s.output_run), (index, s.output_run)))
        loaded = {part: v.load(weight, part) for part in parts}
        for y, x in product(range(rows), range(columns)):
            number = v.everywhere(picture, y * s.stride * s.row + x * s.stride * s.channels)
            for part in parts:
                v.accumulate(sums[y, x, part], number, loaded[part])
    for window, part in product(range((columns + 1) // 2), parts):
        places = [(y, x) for y in range(rows) for x in (2 * window, 2 * window + 1) if x < columns]
        largest, place = _largest(v, [(2 * y + x % 2, v.builder.load(sums[y, x, part])) for y, x in places])
        # What lanes there are beyond the last channel are zeros; the next window overwrites them, or they are frame.
        v.store(largest, out, window * s.outputs + part)
        v.store(place, where, window * s.output_run + part)


def _largest(v: Vectors, candidates: Sequence[tuple[int, Any]]) -> tuple[Any, Any]:
    """Lane by lane the largest number, or zero, and its place, the first of equals; a NaN goes through the ReLU."""

    def places(place: int) -> Any:
        return ir.Constant(ir.VectorType(BYTE, v.lanes), [place] * v.lanes)

    place, largest = candidates[0]
    where = places(place)
    for place, candidate in candidates[1:]:
        larger = v.builder.fcmp_ordered(">", candidate, largest)
        largest = v.builder.select(larger, candidate, largest)
        where = v.builder.select(larger, places(place), where)
    cut = v.builder.fcmp_ordered("<=", largest, v.zero)
    return v.builder.select(cut, v.zero, largest), v.builder.select(cut, places(_DEAD), where)


@vector_code
def _list_places(v: Vectors, s: Shape, gradient: Any, where: Any, starts: Any, factors: Any) -> Any:
    """List one channel's live places: where the patch starts in the picture, and the gradient; returns their number."""
    b, count = v.builder, v.variable(INDEX(0))
    with v.loop(s.pooled_rows) as y, v.loop(s.pooled_columns) as x:
        place = v.number(where, v.index((y, s.pooled_columns * s.output_run), (x, s.output_run)))
        lower, right = b.lshr(place, INDEX(1)), b.and_(place, INDEX(1))
        step_y, step_x = s.stride * s.row, s.stride * s.channels
        start = v.index((y, 2 * step_y), (x, 2 * step_x), (lower, step_y), (right, step_x))
        # Written always, kept if live: a branch would be guessed wrong half of the time.
        index = b.load(count)
        b.store(b.trunc(start, OFFSET), v.at(starts, index))
        b.store(v.number(gradient, v.index((y, s.row_after), (x, s.outputs))), v.at(factors, index))
        b.store(b.add(index, b.zext(b.icmp_unsigned("!=", place, INDEX(_DEAD)), INDEX)), count)
    return b.load(count)


@vector_code
def _add_patches(v: Vectors, s: Shape, pictures: Any, starts: Any, factors: Any, count: Any, sums: Any) -> None:
    """Add the patches listed to a channel's sums, each times its factor."""
    b = v.builder
    for chosen in _portions(list(product(range(s.kernel), range(0, s.run, s.lanes))), s.registers):
        # A sum takes its next number only some cycles later: where sums are few, patches take turns at several.
        turns = range(-(-LATENCY // len(chosen)))
        totals = {(turn, *piece): v.variable(v.zero) for turn in turns for piece in chosen}
        for turn in turns[1:]:
            b.store(FLOAT(0.0), v.at(factors, count, turn - 1))
            b.store(OFFSET(0), v.at(starts, count, turn - 1))
        with v.loop(b.udiv(b.add(count, INDEX(len(turns) - 1)), INDEX(len(turns)))) as index:
            first = v.index((index, len(turns)))
            for turn in turns:
                factor = v.everywhere(factors, first, turn)
                patch = v.at(pictures, v.number(starts, first, turn))
                for y, x in chosen:
                    v.accumulate(totals[turn, y, x], factor, v.load(patch, y * s.row + x))
        for turn, (y, x) in product(turns, chosen):
            v.add_to(sums, y * s.run + x, totals[turn, y, x])


@vector_code
def _add_window(
    v: Vectors, s: Shape, gradient: Any, where: Any, filters: Any, starts: Any, factors: Any, out: Any
) -> None:
    """Hand a window's gradient back to the inputs it saw."""
    b = v.builder
    # Two lists, of live places in the window's upper and in its lower row, so that each touches its own rows only.
    lists = [(v.variable(INDEX(0)), v.at(starts, half), v.at(factors, half)) for half in (0, s.outputs)]
    with v.loop(s.outputs) as channel:
        place, factor = v.number(where, channel), v.number(gradient, channel)
        filter_size = s.kernel * s.seen_run
        start = v.index((channel, 2 * filter_size), (b.and_(place, INDEX(1)), filter_size))
        for half, (count, half_starts, half_factors) in enumerate(lists):
            index = b.load(count)
            b.store(b.trunc(start, OFFSET), v.at(half_starts, index))
            b.store(factor, v.at(half_factors, index))
            here = b.icmp_unsigned("==", b.lshr(place, INDEX(1)), INDEX(half))
            b.store(b.add(index, b.zext(here, INDEX)), count)
    rows = s.kernel + s.stride
    for chosen in _portions(range(0, s.seen_run, s.lanes), max(s.registers // rows, 1)):
        totals = {(y, x): v.variable(v.zero) for y in range(rows) for x in chosen}
        for half, (count, half_starts, half_factors) in enumerate(lists):
            with v.loop(b.load(count)) as index:
                factor = v.everywhere(half_factors, index)
                weights = v.at(filters, v.number(half_starts, index))
                for y, x in product(range(s.kernel), chosen):
                    v.accumulate(totals[y + half * s.stride, x], factor, v.load(weights, y * s.seen_run + x))
        for (y, x), total in totals.items():
            v.add_to(out, y * s.row + x, total)


def _portions(pieces: Sequence[Any], most: int) -> list[Sequence[Any]]:
    """Cut into equal portions of at most so many."""
    size = -(-len(pieces) // -(-len(pieces) // most))
    return [pieces[first : first + size] for first in range(0, len(pieces), size)]
