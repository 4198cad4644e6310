"""A ring of rows sorted by time: columns are numpy arrays, old rows leave at the front, late rows find their place.

The live rows always lie side by side in memory, so that a column is a plain view and a time window a slice of it. Room
is made by moving the live rows to the front when the end is reached; the arrays double only while live rows fill them.
"""

import inspect
from collections.abc import Mapping
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

_NEVER_NS = int(np.iinfo(np.int64).min)


#: A NamedTuple of arrays, one row an entry of each; the first is `t_ns` (N,) int64.
C = TypeVar("C", bound=tuple[NDArray[Any], ...])


class Ring(Generic[C]):
    """Rows sorted by the first column, `t_ns`.

    Rows are known by their index in `columns`; it holds until the next insert or drop.

    Args:
        columns: the arrays, with as many rows as there is room for to begin with.

    Attributes:
        columns: all rows, live or not; another tuple once they had to grow.
        start: the oldest live row.
        stop: one beyond the newest.

    >>> from typing import NamedTuple
    >>> class Values(NamedTuple):
    ...     t_ns: NDArray[np.int64]
    ...     value: NDArray[np.float64]
    >>> ring = Ring(Values(np.zeros(2, np.int64), np.zeros(2)))
    >>> for t_ns in (10, 30, 20):
    ...     row = ring.insert(t_ns)
    ...     ring.columns.value[row] = t_ns / 10
    >>> ring.live.value
    array([1., 2., 3.])
    >>> ring.drop_before(1); ring.live.t_ns
    array([20, 30])
    """

    def __init__(self, columns: C) -> None:
        self.columns = columns
        self.start = self.stop = 0
        self._newest_ns = _NEVER_NS

    def __len__(self) -> int:
        """How many rows are live."""
        return self.stop - self.start

    @property
    def live(self) -> C:
        """Views of the live rows, oldest first."""
        return self._made_of([column[self.start : self.stop] for column in self.columns])

    @property
    def row_bytes(self) -> int:
        """Bytes of one row over all columns."""
        return sum(column[:1].nbytes for column in self.columns)

    def from_ns(self, t_ns: int) -> int:
        """The first row that is not older than `t_ns`; `stop` if there is none."""
        return self.start + int(self.columns[0][self.start : self.stop].searchsorted(t_ns))

    def passed(self, t_ns: int) -> int:
        """The same as `from_ns`, quicker where few rows are older, and not to be asked for more."""
        row, stop, time = self.start, self.stop, self.columns[0].item
        while row < stop and time(row) < t_ns:
            row += 1
        return row

    def has(self, t_ns: int) -> bool:
        """Is there a row of exactly this time?"""
        return t_ns <= self._newest_ns and self.from_ns(t_ns) < self.from_ns(t_ns + 1)

    def at(self, t_ns: int) -> slice:
        """The rows of exactly this time."""
        return slice(self.from_ns(t_ns), self.from_ns(t_ns + 1))

    def insert(self, t_ns: int) -> int:
        """Make a row in its place, after rows of the same time; all its values but the time are the caller's to set."""
        columns = self.columns
        if self.stop == len(columns[0]):
            columns = self._make_room()
        row = self.stop
        self.stop += 1
        if t_ns < self._newest_ns:
            row = self._make_place(t_ns)
        else:
            self._newest_ns = t_ns
        columns[0][row] = t_ns
        return row

    def extend(self, t_ns: NDArray[np.int64]) -> slice:
        """Make rows for ascending times, none older than the newest there; all else is the caller's to set."""
        if self.stop + len(t_ns) > len(self.columns[0]):
            self._make_room(at_least=len(self) + len(t_ns))
        rows = slice(self.stop, self.stop + len(t_ns))
        self.columns[0][rows] = t_ns
        self.stop = rows.stop
        self._newest_ns = int(t_ns[-1]) if len(t_ns) else self._newest_ns
        return rows

    def drop_before(self, row: int) -> None:
        """Forget the rows older than this one."""
        self.start = row

    def clear(self) -> None:
        """Forget all rows."""
        self.start = self.stop = 0
        self._newest_ns = _NEVER_NS

    def state(self) -> dict[str, NDArray[Any]]:
        """Copies of the live rows, by column."""
        return {name: column.copy() for name, column in zip(self._names, self.live, strict=True)}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Hold the rows that `state` gave, and no others."""
        self.clear()
        for t_ns in state["t_ns"].tolist():
            self.insert(t_ns)
        for name, column in zip(self._names, self.live, strict=True):
            column[:] = state[name]

    @property
    def _names(self) -> list[str]:
        return list(inspect.get_annotations(type(self.columns)))

    def _made_of(self, arrays: list[NDArray[Any]]) -> C:
        return type(self.columns)(*arrays)

    def _make_place(self, t_ns: int) -> int:
        """Move what is newer on by a row."""
        self.stop -= 1
        row = self.from_ns(t_ns + 1)
        self.stop += 1
        for column in self.columns:
            column[row + 1 : self.stop] = column[row : self.stop - 1].copy()
        return row

    def _make_room(self, at_least: int = 0) -> C:
        """Move the live rows to the front, of larger arrays if they fill more than half of these."""
        rows = len(self.columns[0])
        grow = max(2 * len(self), at_least) > rows
        moved: list[NDArray[Any]] = []
        for column in self.columns:
            room = np.zeros((max(2 * rows, at_least), *column.shape[1:]), column.dtype) if grow else column
            room[: len(self)] = column[self.start : self.stop].copy()
            moved.append(room)
        self.columns = self._made_of(moved) if grow else self.columns
        self.start, self.stop = 0, len(self)
        return self.columns
