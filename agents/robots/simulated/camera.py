"""The camera: one ray a pixel, mip-mapped textures, one lamp with hard shadows. No GL, the same bytes everywhere.

Each ray that meets a surface looks up its colour there (projected along the surface's own axis nearest its normal, so
boxes, cylinders and balls share one rule), and a second ray from the lamp says whether the lamp reaches that point.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agents.robots.simulated.scenario import Light, Surface
from agents.robots.simulated.textures import SIZE, texture
from agents.robots.simulated.world import World
from llrp_online.configuration.running import Simulation

Floats = NDArray[np.float64]

LEVELS = SIZE.bit_length()  # 512, 256, ..., 1
BEYOND = (175, 182, 190)  # what a ray sees that meets nothing: the hall around the arena
SHADOW_SLACK_M = 0.002  # a lit point is met by its own lamp ray at its own distance, give or take rounding
SIGHT_M = 6.0


@dataclass(frozen=True)
class Optics:
    """A pinhole camera, looking ahead and down.

    `directions` is (height * width, 3) float64, unit rays in the robot's frame, row by row from the top left;
    `pixel_rad` the angle between two neighbouring rays in the picture's middle.

    >>> optics = Optics.build(Simulation(pitch_deg=0.0, field_of_view_deg=90.0), height=2, width=2)
    >>> optics.directions[0].round(3).tolist()  # top left: ahead, to the left, up
    [0.816, 0.408, 0.408]
    """

    height: int
    width: int
    directions: Floats
    pixel_rad: float

    @classmethod
    def build(cls, simulation: Simulation, height: int, width: int) -> "Optics":
        """The camera of this simulation with square pixels; the field of view is the picture's width."""
        focal = width / 2 / np.tan(np.deg2rad(simulation.field_of_view_deg) / 2)
        right, down = np.meshgrid(np.arange(width) + 0.5 - width / 2, np.arange(height) + 0.5 - height / 2)
        pitch = np.deg2rad(simulation.pitch_deg)
        ahead_axis = np.array([np.cos(pitch), 0.0, -np.sin(pitch)])
        down_axis = np.array([-np.sin(pitch), 0.0, -np.cos(pitch)])
        right_axis = np.array([0.0, -1.0, 0.0])
        rays = focal * ahead_axis + right[..., None] * right_axis + down[..., None] * down_axis
        rays = rays.reshape(-1, 3)
        return cls(height, width, rays / np.linalg.norm(rays, axis=1, keepdims=True), 1 / focal)


class Camera:
    """Takes pictures of a world from where the robot stands."""

    def __init__(self, world: World, light: Light, simulation: Simulation, height: int, width: int) -> None:
        self._world = world
        self._optics = Optics.build(simulation, height, width)
        self._mast_m = np.array([simulation.camera_ahead_m, 0.0, simulation.camera_height_m])
        self._textures = _MipMaps(world)
        azimuth, elevation = np.deg2rad([light.azimuth_deg, light.elevation_deg])
        towards = [np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)]
        self._lamp_m = light.distance_m * np.array(towards)
        self._ambient = light.ambient
        self._lamp_rgb = light.strength * np.array([int(light.colour[i : i + 2], 16) / 255 for i in (1, 3, 5)])

    def picture(self, pose: Floats) -> NDArray[np.uint8]:
        """(height, width, 3) uint8 RGB, seen by a robot at `pose` [x_m, y_m, yaw_rad]."""
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        origin_m = turn @ self._mast_m + [pose[0], pose[1], 0.0]
        rays = self._optics.directions @ turn.T
        distance_m, geom, normal = self._world.cast(origin_m, rays, SIGHT_M)

        met = np.flatnonzero(geom >= 0)
        distance_m, geom, normal, rays = distance_m[met], geom[met], normal[met], rays[met]
        points_m = origin_m + rays * distance_m[:, None]
        # The longer the ray and the flatter it falls, the more of the surface one pixel covers.
        slant = np.clip(-np.einsum("ni,ni->n", rays, normal), 0.05, 1.0)
        colour = self._textures.colours(points_m, geom, normal, distance_m * self._optics.pixel_rad / np.sqrt(slant))

        seen = np.empty((self._optics.height * self._optics.width, 3))
        seen[:] = BEYOND
        seen[met] = colour * (self._ambient + self._lamp_share(points_m, normal)[:, None] * self._lamp_rgb)
        picture = np.clip(seen, 0, 255).astype(np.uint8)
        return picture.reshape(self._optics.height, self._optics.width, 3)

    def _lamp_share(self, points_m: Floats, normal: Floats) -> Floats:
        """(N,): cosine between surface and lamp; zero where something stands between."""
        from_lamp = points_m - self._lamp_m
        reach_m = np.linalg.norm(from_lamp, axis=1)
        from_lamp /= reach_m[:, None]
        first_m, _, _ = self._world.cast(self._lamp_m, from_lamp, float(reach_m.max(initial=0.0)) + 1.0)
        facing = np.maximum(-np.einsum("ni,ni->n", from_lamp, normal), 0.0)
        return np.where(first_m < reach_m - SHADOW_SLACK_M, 0.0, facing)


class _MipMaps:
    """Every geom's texture, each in halving sizes, in one flat array: a look-up is one index for all pixels at once."""

    def __init__(self, world: World) -> None:
        surfaces: list[Surface] = []
        for surface in world.surfaces:
            if surface not in surfaces:
                surfaces.append(surface)
        self._texels = np.concatenate([level for surface in surfaces for level in _halvings(texture(surface))])
        self._level_start = np.cumsum([0, *(4**k for k in range(LEVELS - 1, 0, -1))])
        each = int(self._level_start[-1]) + 1
        self._start = np.array([surfaces.index(surface) * each for surface in world.surfaces])
        self._period_m = np.array([surface.period_m for surface in world.surfaces])
        self._world = world

    def colours(self, points_m: Floats, geom: NDArray[np.int32], normal: Floats, pixel_m: Floats) -> Floats:
        """(N, 3) colours in [0, 255] at points on the surfaces of geoms, averaged over about a pixel's size there."""
        axes = self._world.axes[geom]
        local = np.einsum("nij,ni->nj", axes, points_m - self._world.centres_m[geom])
        facing = np.abs(np.einsum("nij,ni->nj", axes, normal)).argmax(1)
        uv = np.take_along_axis(local, _PLANE[facing], 1) / self._period_m[geom, None]
        level = np.clip(np.log2(pixel_m * SIZE / self._period_m[geom]) + 0.5, 0, LEVELS - 1).astype(np.int64)
        size = SIZE >> level
        u, v = (np.floor(uv * size[:, None]).astype(np.int64) & (size - 1)[:, None]).T
        texels = self._texels[self._start[geom] + self._level_start[level] + v * size + u]
        return texels * self._world.tints[geom, None]


_PLANE = np.array([[1, 2], [0, 2], [0, 1]])  # the two axes that span the plane across axis 0, 1 or 2


def _halvings(image: NDArray[np.uint8]) -> list[NDArray[np.float32]]:
    """(SIZE^2, 3), (SIZE^2 / 4, 3), ..., (1, 3): the image and its averages over ever larger squares."""
    level, levels = image.astype(np.float32), []
    for _ in range(LEVELS):
        levels.append(level.reshape(-1, 3))
        half = len(level) // 2
        if half:
            level = level.reshape(half, 2, half, 2, 3).mean((1, 3))
    return levels
