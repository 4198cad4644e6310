"""What the geoms of a world look like: each one's texture in halving sizes, looked up at points on its surface.

A point is projected along the geom's own axis nearest its normal, so that boxes, cylinders and balls share one rule.
"""

import numpy as np
from numpy.typing import NDArray

from agents.robots.simulated.scenario import Surface
from agents.robots.simulated.textures import SIZE, texture
from agents.robots.simulated.world import World

Floats = NDArray[np.float64]

LEVELS = SIZE.bit_length()  # 512, 256, ..., 1
LEVEL_START = np.cumsum([0, *(4**k for k in range(LEVELS - 1, 0, -1))])
HALFWAY = 2.0 ** (
    np.arange(LEVELS - 1) + 0.5
)  # (LEVELS - 1,): from so many texels a pixel on, the next level is nearer
_PLANE = np.array([[1, 2], [0, 2], [0, 1]])  # the two axes that span the plane across axis 0, 1 or 2


class MipMaps:
    """Every geom's texture, each in halving sizes, in one flat array: a look-up is one index for all pixels at once.

    Attributes:
        texels: (T, 3) float32 colours in [0, 255].
        start: (G,) int64, where each geom's texels begin.
        period_m: (G,) its texture repeats after this far.
    """

    def __init__(self, world: World) -> None:
        surfaces: list[Surface] = []
        for surface in world.surfaces:
            if surface not in surfaces:
                surfaces.append(surface)
        self.texels = np.concatenate([level for surface in surfaces for level in _halvings(texture(surface))])
        each = int(LEVEL_START[-1]) + 1
        self.start = np.array([surfaces.index(surface) * each for surface in world.surfaces])
        self.period_m = np.array([surface.period_m for surface in world.surfaces])
        self._world = world

    def colours(self, points_m: Floats, geom: NDArray[np.int32], normal: Floats, pixel_m: Floats) -> Floats:
        """(N, 3) colours in [0, 255] at points on the surfaces of geoms, averaged over about a pixel's size there."""
        local = self._world.into_frame(geom, points_m - self._world.centres_m[geom])
        facing = np.abs(self._world.into_frame(geom, normal)).argmax(1)
        period_m = self.period_m[geom]
        uv = np.take_along_axis(local, _PLANE[facing], 1) / period_m[:, None]
        level = np.searchsorted(HALFWAY, pixel_m * SIZE / period_m, side="right")
        size = SIZE >> level
        u, v = (np.floor(uv * size[:, None]).astype(np.int64) & (size - 1)[:, None]).T
        texels = self.texels[self.start[geom] + LEVEL_START[level] + v * size + u]
        return texels * self._world.tints[geom, None]


def _halvings(image: NDArray[np.uint8]) -> list[NDArray[np.float32]]:
    """(SIZE^2, 3), (SIZE^2 / 4, 3), ..., (1, 3): the image and its averages over ever larger squares."""
    level, levels = image.astype(np.float32), []
    for _ in range(LEVELS):
        levels.append(level.reshape(-1, 3))
        half = len(level) // 2
        if half:
            level = level.reshape(half, 2, half, 2, 3).mean((1, 3))
    return levels
