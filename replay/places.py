"""The label rule's constants for one set of targets, and a hash of the targets by place.

The hash says which few targets a reading may be within tolerance of, from where it lies as seen from the frame. So the
cost of a pair of frame and reading does not grow with the number of targets, on a grid or on any list.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from replay.poses import Floats
from replay.rule import LabelRule
from replay.targets import Targets

_MOST_CELLS_AN_AXIS = 1024
#: Of a cell's side, or of the tolerance: rounding must not lose a target at the edge.
_MARGIN = 1e-6


class Places(NamedTuple):
    """As arrays and numbers, for the reference and the kernels alike.

    The plane around a frame is cut into cells, the outermost of which are near no target; what lies beyond counts as in
    them. The targets near cell `c` are `near[first[c] : first[c + 1]]`.

    Attributes:
        x_m, y_m, yaw_rad: (T,) float64 of the targets.
        first: (cells + 1,) int32.
        near: (entries,) int32 targets.
        corner_m: (2,) float64 where the cells begin.
        per_m: (2,) float64 cells a metre, along x and y.
        cells: (2,) int64, along x and y.
        sensors: (streams, sensors of the widest) int64, padded with -1.
        position_tolerance_m, gate_m, window_ns: of the rule.
        heading_tolerance_rad: of the rule; inf where it ignores the heading.
    """

    x_m: Floats
    y_m: Floats
    yaw_rad: Floats
    first: NDArray[np.int32]
    near: NDArray[np.int32]
    corner_m: Floats
    per_m: Floats
    cells: NDArray[np.int64]
    sensors: NDArray[np.int64]
    position_tolerance_m: float
    heading_tolerance_rad: float
    gate_m: float
    window_ns: int

    @staticmethod
    def of(targets: Targets, streams: Sequence[Sequence[int]], rule: LabelRule) -> "Places":
        """For these targets, the sensors of each stream, and this rule."""
        x_m, y_m, yaw_rad = targets.poses.T.copy()
        sensors = np.full((len(streams), max(map(len, streams))), -1, np.int64)
        for stream, members in enumerate(streams):
            sensors[stream, : len(members)] = members
        heading = rule.heading_tolerance_rad
        return Places(
            x_m,
            y_m,
            yaw_rad,
            *_hash(np.stack([x_m, y_m], -1), rule.position_tolerance_m),
            sensors,
            float(rule.position_tolerance_m),
            np.inf if heading is None else float(heading),
            float(rule.gate_m),
            rule.window_ns,
        )

    def find(self, x_m: Floats, y_m: Floats) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Which of the points (N,), as seen from their frames, may be near which targets: (M,) indices of each."""
        cx, cy = (
            np.clip((at - self.corner_m[axis]) * self.per_m[axis], 0, self.cells[axis] - 1).astype(np.int64)
            for axis, at in enumerate((x_m, y_m))
        )
        cell = cx * self.cells[1] + cy
        begin = self.first[cell].astype(np.int64)
        count = self.first[cell + 1] - begin
        point = np.repeat(np.arange(len(cell)), count)
        rank = np.arange(len(point)) - np.repeat(np.cumsum(count) - count, count)
        return point, self.near[begin[point] + rank].astype(np.int64)


def _hash(
    at_m: Floats, tolerance_m: float
) -> tuple[NDArray[np.int32], NDArray[np.int32], Floats, Floats, NDArray[np.int64]]:
    """`first`, `near`, `corner_m`, `per_m`, `cells` for targets at (T, 2).

    Half a tolerance is a good side for a cell: smaller, and the table outgrows the cache; larger, and more points are
    measured in vain.
    """
    low, high = at_m.min(0), at_m.max(0)
    reach_m = tolerance_m * (1 + _MARGIN)
    side_m = np.maximum(tolerance_m / 2, (high - low + 2 * reach_m) / (_MOST_CELLS_AN_AXIS - 4))
    corner_m = low - reach_m - 1.5 * side_m
    cells = ((high + reach_m - corner_m) / side_m).astype(np.int64) + 2
    home = ((at_m - corner_m) / side_m).astype(np.int64)
    around = int(np.ceil((reach_m / side_m).max())) + 1
    offsets = np.stack(np.meshgrid(*[np.arange(-around, around + 1)] * 2, indexing="ij"), -1).reshape(-1, 2)
    found = home[:, None, :] + offsets
    middle_m = corner_m + (found + 0.5) * side_m
    short_m = np.maximum(np.abs(middle_m - at_m[:, None, :]) - side_m * (0.5 + _MARGIN), 0.0)
    target, which = np.nonzero((short_m**2).sum(-1) <= reach_m**2)
    key = found[target, which, 0] * cells[1] + found[target, which, 1]
    order = np.argsort(key, kind="stable")
    first = np.searchsorted(key[order], np.arange(int(cells.prod()) + 1)).astype(np.int32)
    return first, target[order].astype(np.int32), corner_m, 1 / side_m, cells
