"""A ring of rows sorted by time: columns are numpy arrays, old rows leave at the front, late rows find their place.

The live rows always lie side by side in memory, so that a column is a plain view and a time window a slice of it. Room
is made by moving the live rows to the front when the end is reached; the arrays double only while live rows fill them.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray


class Ring:
    """Rows sorted by the column `t_ns`.

    Args:
        columns: name to (dtype, shape of one row's value); `t_ns` is added.
        capacity: rows to begin with.

    >>> ring = Ring({"value": (np.float64, ())}, capacity=2)
    >>> [ring.insert(t, {"value": t / 10}) for t in (10, 30, 20)]
    [0, 1, 1]
    >>> ring["value"]
    array([1., 2., 3.])
    >>> ring.drop(1); ring["t_ns"]
    array([20, 30])
    """

    def __init__(self, columns: Mapping[str, tuple[DTypeLike, tuple[int, ...]]], capacity: int = 64) -> None:
        shapes: dict[str, tuple[DTypeLike, tuple[int, ...]]] = {"t_ns": (np.int64, ()), **columns}
        self._columns: dict[str, NDArray[Any]] = {
            name: np.zeros((capacity, *shape), dtype) for name, (dtype, shape) in shapes.items()
        }
        self._capacity = capacity
        self._start = self._stop = 0

    def __len__(self) -> int:
        """How many rows are live."""
        return self._stop - self._start

    def __getitem__(self, column: str) -> NDArray[Any]:
        """A view of the live rows of one column, oldest first; valid until the next insert or drop."""
        return self._columns[column][self._start : self._stop]

    @property
    def row_bytes(self) -> int:
        """Bytes of one row over all columns."""
        return sum(column[:1].nbytes for column in self._columns.values())

    def has(self, t_ns: int) -> bool:
        """Is there a row of exactly this time?"""
        at = int(np.searchsorted(self["t_ns"], t_ns))
        return at < len(self) and int(self["t_ns"][at]) == t_ns

    def between(self, from_ns: int, to_ns: int) -> slice:
        """The rows with from_ns <= t <= to_ns, as a slice of every column."""
        times = self["t_ns"]
        return slice(int(np.searchsorted(times, from_ns, "left")), int(np.searchsorted(times, to_ns, "right")))

    def insert(self, t_ns: int, values: Mapping[str, Any]) -> int:
        """Add a row in its place (after rows of the same time) and return its index among the live rows."""
        if self._stop == self._capacity:
            self._make_room()
        at = len(self)
        if at and t_ns < self["t_ns"][-1]:
            at = int(np.searchsorted(self["t_ns"], t_ns, "right"))
        row = self._start + at
        self._stop += 1
        for name, column in self._columns.items():
            column[row + 1 : self._stop] = column[row : self._stop - 1]
            column[row] = t_ns if name == "t_ns" else values.get(name, 0)
        return at

    def drop(self, rows: int) -> None:
        """Forget the oldest rows."""
        self._start += rows

    def clear(self) -> None:
        """Forget all rows."""
        self._start = self._stop = 0

    def state(self) -> dict[str, NDArray[Any]]:
        """Copies of the live rows, by column."""
        return {name: self[name].copy() for name in self._columns}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Hold the rows that `state` gave, and no others."""
        self.clear()
        for row in range(len(state["t_ns"])):
            self.insert(int(state["t_ns"][row]), {name: column[row] for name, column in state.items()})

    def _make_room(self) -> None:
        live = len(self)
        grow = live > self._capacity // 2
        self._capacity *= 2 if grow else 1
        for name, column in self._columns.items():
            moved = np.zeros((self._capacity, *column.shape[1:]), column.dtype) if grow else column
            moved[:live] = column[self._start : self._stop].copy()
            self._columns[name] = moved
        self._start, self._stop = 0, live
