"""The floor: one level of smooth noise, black below zero and white above, in halving sizes for what is seen from afar.

The noise is Perlin's: a random direction at each point of a lattice, and between the points a smooth blend of the four
slopes around (K. Perlin, "Improving noise", 2002). One octave alone, so that spots are about a lattice cell wide.
"""

import math

import numpy as np
from numpy.typing import NDArray

from agents.robots.pioneer.world import FloorTable

Floats = NDArray[np.floating]
WHITE = 255


class Floor:
    """One map; its middle is at (0, 0), its axes are x and y.

    Attributes:
        texels: (n, n) uint8, 0 or 255; rows along y, columns along x, from the corner with the least of both.
        half_m: from the middle to an edge.

    Args:
        settings: of the map.
        seed: of its noise.

    >>> floor = Floor(FloorTable(side_m=10.0, cell_m=2.0, texel_m=0.05), seed=0)
    >>> floor.texels.shape, sorted(set(floor.texels.ravel().tolist()))
    ((200, 200), [0, 255])
    """

    def __init__(self, settings: FloorTable, seed: int) -> None:
        self._settings = settings
        self.half_m = settings.side_m / 2
        size = math.ceil(settings.side_m / settings.texel_m)
        at = (np.arange(size) + 0.5) * (settings.side_m / size / settings.cell_m)
        self.texels: NDArray[np.uint8] = np.where(perlin(at, at, np.random.default_rng(seed)) > 0, WHITE, 0).astype(
            np.uint8
        )
        levels = _halvings(self.texels)
        self._flat = np.concatenate([level.ravel() for level in levels])
        self._size = np.array([len(level) for level in levels], np.int32)
        self._start = np.cumsum([0, *(level.size for level in levels[:-1])]).astype(np.int32)
        self._texel_m = settings.side_m / size

    def levels_for(self, pixel_m: Floats) -> NDArray[np.int64]:
        """Which of the halving sizes has texels nearest to a pixel's size on the floor [m], same shape."""
        level = np.round(np.log2(np.maximum(pixel_m / self._texel_m, 1.0)))
        return np.minimum(level, len(self._size) - 1).astype(np.int64)

    def greys(self, x_m: Floats, y_m: Floats, level: NDArray[np.int64]) -> NDArray[np.uint8]:
        """Grey at points of the floor, in texels of a level each; `beyond` outside the map. All (N,)."""
        size = self._size[level]
        per_m = size / np.float32(self._settings.side_m)
        column = np.floor((x_m + self.half_m) * per_m).astype(np.int32)
        row = np.floor((y_m + self.half_m) * per_m).astype(np.int32)
        inside = (column >= 0) & (column < size) & (row >= 0) & (row < size)
        index = np.where(inside, self._start[level] + row * size + column, 0)
        return np.where(inside, self._flat[index], np.uint8(self._settings.beyond))

    def mean_grey(self, x_m: float, y_m: float, side_m: float) -> float:
        """Mean over a square of the map, 0 black to 1 white; ValueError if none of it lies on the map."""
        (left, right), (bottom, top) = (
            (
                max(round((at + self.half_m - side_m / 2) / self._texel_m), 0),
                round((at + self.half_m + side_m / 2) / self._texel_m),
            )
            for at in (x_m, y_m)
        )
        seen = self.texels[bottom:top, left:right]
        if not seen.size:
            raise ValueError(f"floor at ({x_m:g}, {y_m:g}) m: expected a place within {self.half_m:g} m of the middle")
        return float(seen.mean()) / WHITE


def perlin(x: Floats, y: Floats, rng: np.random.Generator) -> Floats:
    """Noise around zero on a grid: (X,), (Y,) in lattice cells, not negative -> (Y, X); zero at lattice points."""
    angle = rng.uniform(0, 2 * np.pi, (int(y.max()) + 2, int(x.max()) + 2))
    slope_x, slope_y = np.cos(angle), np.sin(angle)
    column, row = np.floor(x).astype(np.int64)[None, :], np.floor(y).astype(np.int64)[:, None]
    right, up = x[None, :] - column, y[:, None] - row

    def corner(i: int, j: int) -> Floats:
        at = row + j, column + i
        return slope_x[at] * (right - i) + slope_y[at] * (up - j)

    across, along = _fade(right), _fade(up)
    below = corner(0, 0) * (1 - across) + corner(1, 0) * across
    above = corner(0, 1) * (1 - across) + corner(1, 1) * across
    return below * (1 - along) + above * along


def _fade(share: Floats) -> Floats:
    return share**3 * (share * (share * 6 - 15) + 10)


def _halvings(texels: NDArray[np.uint8]) -> list[NDArray[np.uint8]]:
    """The map and its means over ever larger squares, as long as they come out even."""
    exact, levels = texels.astype(np.float32), [texels]
    while len(exact) % 2 == 0:
        half = len(exact) // 2
        exact = exact.reshape(half, 2, half, 2).mean((1, 3))
        levels.append(np.round(exact).astype(np.uint8))
    return levels
