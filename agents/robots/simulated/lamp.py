"""The lamp: how much of its light reaches a point, and which solids can throw their shadow where."""

import numpy as np
from numpy.typing import NDArray

from agents.robots.simulated.scenario import Light
from agents.robots.simulated.world import World

Floats = NDArray[np.float64]

SHADOW_SLACK_M = 0.002  # a lit point is met by its own lamp ray at its own distance, give or take rounding
SAME_M = 1e-9  # points so near are one
CELLS = 128  # of the shadow map, along each side
MARGIN_M = 1.0  # around the arena: what stands at a wall throws its shadow beyond


class Lamp:
    """One lamp, or a far-away sun, above the floor.

    Attributes:
        position_m: (3,) float64, in the arena.
        ambient: brightness in the shadow, as the camera takes it.
        rgb: (3,) float64, brightness it adds to a surface that faces it.
    """

    def __init__(self, light: Light, exposure: float = 1.0) -> None:
        azimuth, elevation = np.deg2rad([light.azimuth_deg, light.elevation_deg])
        towards = [np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)]
        self.position_m: Floats = light.distance_m * np.array(towards)
        self.ambient = exposure * light.ambient
        colour = np.array([int(light.colour[i : i + 2], 16) / 255 for i in (1, 3, 5)])
        self.rgb: Floats = exposure * (light.strength * colour)

    def share(self, world: World, points_m: Floats, normal: Floats) -> Floats:
        """(N,): cosine between surface and lamp; zero where something stands between."""
        from_lamp = points_m - self.position_m
        reach_m = np.sqrt(dot(from_lamp, from_lamp))
        from_lamp /= reach_m[:, None]
        first_m, _, _ = world.cast(self.position_m, from_lamp, float(reach_m.max(initial=0.0)) + 1.0)
        facing = np.maximum(-dot(from_lamp, normal), 0.0)
        return np.where(first_m < reach_m - SHADOW_SLACK_M, 0.0, facing)


class ShadowMap:
    """The solids that may stand between the lamp and what is in its light, by where that light would meet the floor.

    Most solids stand still, so a grid over the floor knows once for all whose shadow falls where. A point above the
    floor is in the way of the same light as the floor's point behind it; points whose light falls beyond the grid have
    a cell of their own, the last, with all solids. What moves is in every cell: its shadow is looked for by rays alone.

    Attributes:
        lamp_m: (S, 3) float64, where the lamp is in each solid's frame.
        grid: [x_m, y_m] of its corner, cells a metre along x and along y, CELLS.
        start: (CELLS^2 + 2,) int32: the solids of cell i are `members[start[i] : start[i + 1]]`.
        members: (M,) int32.
    """

    def __init__(self, world: World, lamp: Lamp) -> None:
        self._world, self._lamp = world, lamp
        self.lamp_m: Floats = np.empty((len(world.solids), 3))
        self.follow()
        half_m = np.array(world.floor_half_m) + MARGIN_M
        cell_m = 2 * half_m / CELLS
        self.grid: Floats = np.array([*-half_m, *1 / cell_m, CELLS])
        middles = (np.arange(CELLS)[:, None] + 0.5) * cell_m - half_m
        x, y = middles[None, :, 0], middles[:, None, 1]
        count = len(world.solids)
        shaded = np.ones((CELLS * CELLS + 1, count), bool)
        for index, solid in enumerate(world.solids[: count - world.moving]):
            edges = _shadow(solid, lamp.position_m)
            # A cell is touched where its middle is no farther outside than its corner is from the middle.
            outside_m = [a * x + b * y + c for a, b, c in edges]
            if outside_m:
                shaded[:-1, index] = (np.max(outside_m, 0) <= np.hypot(*cell_m)).ravel()
        self.start = np.concatenate([[0], np.cumsum(shaded.sum(1))]).astype(np.int32)
        self.members = np.nonzero(shaded)[1].astype(np.int32)

    def follow(self) -> None:
        """Look where the solids stand now."""
        x, y, z = (self._lamp.position_m - self._world.solids[:, 1:4]).T
        cos, sin, up = self._world.solids[:, 4:7].T
        self.lamp_m[:] = np.stack([cos * x + sin * y, cos * y - sin * x, up * z], 1)


def _shadow(solid: Floats, lamp_m: Floats) -> Floats:
    """(E, 3): its shadow is where a x + b y + c <= 0 for each edge [a, b, c], a^2 + b^2 = 1; no edge: anywhere."""
    _, x, y, z, cos, sin, _, *half = solid
    signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
    along = signs * half
    corners = np.stack([x + cos * along[:, 0] - sin * along[:, 1], y + sin * along[:, 0] + cos * along[:, 1]], 1)
    below_lamp_m = lamp_m[2] - (z + along[:, 2])
    if below_lamp_m.min() <= SHADOW_SLACK_M:
        return np.empty((0, 3))
    return _hull(lamp_m[:2] + (corners - lamp_m[:2]) * (lamp_m[2] / below_lamp_m)[:, None])


def _hull(points: Floats) -> Floats:
    """(E, 3): the edges of the convex hull of a few points (N, 2): the lines through two of them with none beyond."""
    way = points[None] - points[:, None]
    length = np.hypot(way[..., 0], way[..., 1])
    start, stop = np.nonzero(length > SAME_M)
    normal = np.stack([way[start, stop, 1], -way[start, stop, 0]], 1) / length[start, stop, None]
    lines = np.column_stack([normal, -(normal * points[start]).sum(1)])
    beyond_m = lines[:, :2] @ points.T + lines[:, 2:]
    return lines[beyond_m.max(1) <= SAME_M]


def dot(a: Floats, b: Floats) -> Floats:
    """(N, 3) and (N, 3) -> (N,), in an order of its own: numpy's products differ in the last bit between machines."""
    return a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2]
