"""Vector code inside kernels: what numba's own loops cannot say, for they keep no row of sums in registers.

A function that writes such code, LLVM instruction by instruction, is made callable from a kernel by `vector_code`.
"""

from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from functools import wraps
from typing import Any

from llvmlite import ir
from numba import types as _types
from numba.core import cgutils
from numba.extending import intrinsic

from llrp_online.blocks.shape import Shape

types: Any = _types  # as it annotates them, tuples and arrays would have no elements
FLOAT, BYTE, OFFSET, INDEX = ir.FloatType(), ir.IntType(8), ir.IntType(32), ir.IntType(64)


class Vectors:
    """Writes vector code."""

    def __init__(self, builder: Any, lanes: int) -> None:
        self.builder = builder
        self.lanes = lanes
        self.type = ir.VectorType(FLOAT, lanes)
        self.zero = ir.Constant(self.type, [0.0] * lanes)
        signature = ir.FunctionType(self.type, [self.type] * 3)
        name = f"llvm.fmuladd.v{lanes}f32"
        self._multiply_add = cgutils.get_or_insert_function(builder.module, signature, name)

    def at(self, pointer: Any, *offsets: Any) -> Any:
        """The pointer, so many elements on."""
        for offset in offsets:
            pointer = self.builder.gep(pointer, [INDEX(offset) if isinstance(offset, int) else offset])
        return pointer

    def number(self, pointer: Any, *offsets: Any) -> Any:
        """One number, or an integer as an index."""
        value = self.builder.load(self.at(pointer, *offsets))
        return value if value.type == FLOAT else self.builder.sext(value, INDEX)

    def everywhere(self, pointer: Any, *offsets: Any) -> Any:
        """One number in every lane."""
        first = self.builder.insert_element(
            ir.Constant(self.type, ir.Undefined), self.number(pointer, *offsets), ir.IntType(32)(0)
        )
        lanes = ir.Constant(ir.VectorType(ir.IntType(32), self.lanes), [0] * self.lanes)
        return self.builder.shuffle_vector(first, ir.Constant(self.type, ir.Undefined), lanes)

    def load(self, pointer: Any, *offsets: Any) -> Any:
        """Consecutive numbers, aligned or not."""
        source = self.builder.bitcast(self.at(pointer, *offsets), self.type.as_pointer())
        return self.builder.load(source, align=4)

    def store(self, vector: Any, pointer: Any, *offsets: Any) -> None:
        """To consecutive numbers or bytes, aligned or not."""
        target = self.builder.bitcast(self.at(pointer, *offsets), vector.type.as_pointer())
        self.builder.store(vector, target, align=4 if vector.type == self.type else 1)

    def variable(self, value: Any) -> Any:
        """What changes, and yet stays in a register: a vector of sums, or a count."""
        return cgutils.alloca_once_value(self.builder, value)

    def accumulate(self, variable: Any, a: Any, b: Any) -> None:
        """variable += a * b, lane by lane."""
        self.builder.store(self.builder.call(self._multiply_add, [a, b, self.builder.load(variable)]), variable)

    def add_to(self, pointer: Any, offset: int, variable: Any) -> None:
        """Add a variable to consecutive numbers in memory."""
        self.store(self.builder.fadd(self.load(pointer, offset), self.builder.load(variable)), pointer, offset)

    def index(self, *products: tuple[Any, int]) -> Any:
        """The sum of integers times constants."""
        total: Any = INDEX(0)
        for value, factor in products:
            total = self.builder.add(total, self.builder.mul(value, INDEX(factor)))
        return total

    @contextmanager
    def loop(self, count: Any) -> Generator[Any]:
        """Yields the index."""
        count = INDEX(count) if isinstance(count, int) else count
        with cgutils.for_range(self.builder, count, intp=INDEX) as loop:
            yield loop.index


def vector_code(write: Callable[..., Any]) -> Any:
    """Make `write(vectors, shape, ...)` callable from kernels, where it becomes the code that it writes.

    The kernel gives the shape as a tuple. What else it gives arrives thus: an array, or an (array, offset), as a
    pointer; a tuple of constants as it is; an integer as LLVM's. What `write` returns, if anything, is an index.
    """

    @wraps(write)  # the kernel's compiler reads the names of the arguments there
    def define(_: Any, *given: Any) -> Any:
        kinds = [kind if isinstance(kind, types.BaseTuple | types.Array) else types.intp for kind in given]
        returned_type = types.void if write.__annotations__["return"] is None else types.intp

        def code(context: Any, builder: Any, signature: Any, values: Sequence[Any]) -> Any:
            def pointer(kind: Any, value: Any) -> Any:
                return context.make_array(kind)(context, builder, value).data

            arguments: list[Any] = []
            for kind, value in zip(signature.args, values, strict=True):
                if isinstance(kind, types.Array):
                    arguments.append(pointer(kind, value))
                elif isinstance(kind, types.BaseTuple) and isinstance(kind[0], types.Array):
                    array, offset = (builder.extract_value(value, part) for part in (0, 1))
                    arguments.append(builder.gep(pointer(kind[0], array), [offset]))
                elif isinstance(kind, types.BaseTuple):
                    arguments.append(tuple(constant.literal_value for constant in kind))
                else:
                    arguments.append(value)
            shape = Shape(*arguments[0])
            returned = write(Vectors(builder, shape.lanes), shape, *arguments[1:])
            return context.get_dummy_value() if returned is None else returned

        return returned_type(*kinds), code

    return intrinsic(prefer_literal=True)(define)
