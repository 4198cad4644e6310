"""The camera: one ray a pixel, mip-mapped textures, one lamp with hard shadows. No GL, the same bytes everywhere.

Each ray that meets a surface looks up its colour there, and a second ray from the lamp says whether the lamp reaches
that point. `Camera` does it with MuJoCo's rays and numpy; where `kernels.py` could be compiled, with that: the same
pictures, many times faster. So that they are the same, neither leaves the order of a sum to a library. What makes a
picture less than sharp is done afterwards (`lens.py`).
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.robots.simulated import lens
from agents.robots.simulated.lamp import SHADOW_SLACK_M, Lamp, ShadowMap, dot
from agents.robots.simulated.mipmaps import HALFWAY, LEVEL_START, MipMaps
from agents.robots.simulated.scenario import Light
from agents.robots.simulated.world import World, turned
from llrp_online.configuration.running import Simulation
from replay.compiling import Compiled

Floats = NDArray[np.float64]
Eye = tuple[float, float, float, float, float]  # x, y, z [m], and cosine and sine of the yaw

BEYOND = (175, 182, 190)  # what a ray sees that meets nothing: the hall around the arena
SIGHT_M = 6.0
STEEPEST = 0.05  # least cosine between ray and normal that a pixel's size is computed for


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
        self._ahead_m, self._height_m = simulation.camera_ahead_m, simulation.camera_height_m
        self._textures = MipMaps(world)
        self._lamp = Lamp(light, simulation.exposure)
        self._beyond: Floats = np.minimum(simulation.exposure * np.array(BEYOND), 255.0)
        self._open_share = simulation.shutter_s * simulation.rate_hz
        self._blur_px = simulation.blur_px
        self._kernels = Compiled("agents.robots.simulated.kernels")
        self._shadows = ShadowMap(world, self._lamp)
        self._scene = self._told(simulation)

    def picture(self, pose: Floats, before: Floats | None = None) -> NDArray[np.uint8]:
        """(height, width, 3) uint8 RGB, seen by a robot at `pose` [x_m, y_m, yaw_rad].

        One tick ago it stood at `before`; without it, it stands still. Other things stand still while the shutter is
        open.
        """
        if before is None or not self._open_share:
            picture = self._sharp(pose)
        else:
            picture = lens.smeared([self._sharp(at) for at in lens.way(before, pose, self._open_share)])
        return lens.blurred(picture, self._blur_px) if self._blur_px else picture

    def _sharp(self, pose: Floats) -> NDArray[np.uint8]:
        x, y, yaw = pose.tolist()
        cos, sin = math.cos(yaw), math.sin(yaw)
        eye = x + self._ahead_m * cos, y + self._ahead_m * sin, self._height_m, cos, sin
        kernels = self._kernels.get()
        if kernels is None:
            picture = self._followed(eye)
        else:
            picture = np.empty((len(self._optics.directions), 3), np.uint8)
            self._follow()
            kernels.picture(eye, *self._scene, picture)
        return picture.reshape(self._optics.height, self._optics.width, 3)

    def _followed(self, eye: Eye) -> NDArray[np.uint8]:
        """(height * width, 3), ray by ray: the reference."""
        origin_m = np.array(eye[:3])
        rays = turned(self._optics.directions, *eye[3:])
        distance_m, geom, normal = self._world.cast(origin_m, rays, SIGHT_M)

        met = np.flatnonzero(geom >= 0)
        distance_m, geom, normal, rays = distance_m[met], geom[met], normal[met], rays[met]
        points_m = origin_m + rays * distance_m[:, None]
        # The longer the ray and the flatter it falls, the more of the surface one pixel covers.
        slant = np.clip(-dot(rays, normal), STEEPEST, 1.0)
        colour = self._textures.colours(points_m, geom, normal, distance_m * self._optics.pixel_rad / np.sqrt(slant))

        seen = np.empty((len(self._optics.directions), 3))
        seen[:] = self._beyond
        share = self._lamp.share(self._world, points_m, normal)
        seen[met] = colour * (self._lamp.ambient + share[:, None] * self._lamp.rgb)
        return np.clip(seen, 0, 255).astype(np.uint8)

    def _follow(self) -> None:
        """Tell the compiled rays where the things that move are now."""
        if self._world.moving:
            self._shadows.follow()
            surfaces = self._scene[2][0]
            surfaces[:, 1:4] = self._world.centres_m

    def _told(self, simulation: Simulation) -> tuple[Any, ...]:
        """The scene as `kernels.picture` takes it: optics, solids, textures, lamp and shadows."""
        optics, world, textures, lamp, shadows = self._optics, self._world, self._textures, self._lamp, self._shadows
        down = optics.directions[:, 2]
        floor_m = np.full(len(down), np.inf)
        np.divide(-simulation.camera_height_m, down, out=floor_m, where=down < 0)
        floor_m[floor_m > SIGHT_M] = np.inf
        pitch, middle = np.deg2rad(simulation.pitch_deg), (optics.width / 2, optics.height / 2)
        numbers = [1 / optics.pixel_rad, np.cos(pitch), np.sin(pitch), *middle, optics.pixel_rad]
        surfaces = np.column_stack([textures.period_m, world.centres_m, world.turns, world.tints])
        return (
            (np.array([*numbers, SIGHT_M, STEEPEST, *world.floor_half_m, *self._beyond]), optics.directions, floor_m),
            world.solids,
            (surfaces, textures.start, textures.texels, LEVEL_START, HALFWAY),
            (
                np.array([*lamp.position_m, SHADOW_SLACK_M, lamp.ambient, *lamp.rgb]),
                shadows.lamp_m,
                shadows.grid,
                shadows.start,
                shadows.members,
            ),
        )
