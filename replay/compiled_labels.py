"""The label rule by its kernels, and the choice between them and the reference."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.compiling import Compiled
from replay.labels import Reference
from replay.solver import Collected, Solver, Store
from replay.track import Settled


class CompiledSolver:
    """See `replay.solver.Solver`; to be asked only where `ready` says so.

    Args:
        store: the rings.
    """

    def __init__(self, store: Store) -> None:
        self._store = store
        self._compiled = Compiled("replay.label_kernels")
        self._kernels: Any = None
        places = store.places
        tolerances = (places.position_tolerance_m, places.heading_tolerance_rad, places.gate_m)
        self._rule = (tolerances, places.window_ns)
        self._shape = store.frames.columns.labels.shape[1:]
        self._columns: tuple[Any, Any, Any] = (None, None, None)
        self._at: NDArray[np.int64] = np.empty(0, np.int64)

    @property
    def ready(self) -> bool:
        """Are there kernels, and are they wanted? It may change between two messages."""
        self._kernels = self._compiled.get()
        return self._kernels is not None

    def take_reading(self, row: int) -> bool:
        """One reading."""
        return self._kernels.take_reading(*self._rows(), *self._rule, row)

    def take_frames(self, first: int, last: int) -> bool:
        """Some frames."""
        return self._kernels.take_frames(*self._rows(), *self._rule, first, last)

    def take_odometry(self, settled: Settled) -> bool:
        """One sample of odometry."""
        return self._kernels.take_odometry(*self._rows(), *self._rule, *settled)

    def collect(self, closing: int, *, only_closed: bool) -> Collected:
        """What is to be handed out."""
        rows = self._rows()
        room = self._kernels.count(*rows, closing, only_closed)
        found = Collected.room(room, self._shape)
        filled = self._kernels.collect(*rows, closing, only_closed, *found) if room else 0
        return found if filled == room else found.first_rows(filled)

    def _rows(self) -> tuple[Any, ...]:
        """Where the columns are, and which of their rows are live."""
        track, readings, frames, _ = self._store
        samples, said, waiting = self._columns
        if track.columns is not samples or readings.columns is not said or frames.columns is not waiting:
            self._columns = track.columns, readings.columns, frames.columns
            self._at = self._kernels.addresses(self._store)
        live = (track.start, track.stop, readings.start, readings.stop, frames.start, frames.stop)
        return self._at, live


class Solvers:
    """Both forms of the rule over one store.

    Args:
        store: the rings.
    """

    def __init__(self, store: Store) -> None:
        self._fast, self._plain = CompiledSolver(store), Reference(store)

    @property
    def now(self) -> Solver:
        """The one to ask now."""
        return self._fast if self._fast.ready else self._plain
