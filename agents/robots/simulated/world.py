"""The arena as a MuJoCo scene: the one place where rays meet shapes. No GL is needed.

Walls and obstacles stand still for good; a few shapes may be moved about the floor between two looks (`World.move`).
The robot is not part of the scene: its camera and its sensors look outwards from its rim, so it never sees itself.

MuJoCo is the reference. `solids` tells the compiled rays (`kernels.py`) where everything stands, with the numbers that
MuJoCo has, so that both meet the same things at the same distances.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.extras import install
from agents.robots.simulated.layout import Layout, Shape
from agents.robots.simulated.scenario import Surface

Floats = NDArray[np.float64]
KINDS = ("box", "cylinder", "ball")


class World:
    """Casts rays into a layout. `surfaces` and `tints` tell, by the geom a ray met, what it looks like there.

    The floor is geom 0, the layout's shapes follow in their order, then what moves: MuJoCo keeps the order in which
    geoms were added.

    Args:
        layout: what stands still.
        moving: M shapes that `move` moves, at first where they say; each blocks rays as any other.

    Attributes:
        moving: M; these are the last geoms, and the last solids.
        surfaces: of the G geoms.
        tints: (G,) float64.
        centres_m: (G, 3) float64.
        turns: (G, 3) float64: cosine and sine of each geom's turn about the vertical, and 1, as MuJoCo rounds it.
        floor_half_m: half the floor's length and width.
        solids: (G - 1, 10) float64, a row a shape: index in `KINDS`, centre, turn, half extents. A ball is not turned:
            rays meet it the same way from all sides.
    """

    def __init__(self, layout: Layout, moving: Sequence[Shape] = ()) -> None:
        self._mujoco = _import_mujoco()
        self._model = self._compile(layout, moving)
        self._data = self._mujoco.MjData(self._model)
        self._mujoco.mj_forward(self._model, self._data)
        arena, shapes = layout.scenario.arena, [*layout.shapes, *moving]
        self.moving = len(moving)
        self.floor_half_m = (arena.length_m / 2, arena.width_m / 2)
        self.surfaces: list[Surface] = [
            layout.scenario.surface_named(arena.floor),
            *(shape.surface for shape in shapes),
        ]
        self.tints: Floats = np.array([1.0, *(shape.tint for shape in shapes)])
        self.centres_m: Floats = self._data.geom_xpos.copy()
        axes: Floats = self._data.geom_xmat.reshape(-1, 3, 3)
        self.turns: Floats = np.stack([axes[:, 0, 0], axes[:, 1, 0], axes[:, 2, 2]], 1)
        self.solids: Floats = np.array([self._solid(i + 1, shape) for i, shape in enumerate(shapes)])
        self.solids = self.solids.reshape(-1, 10)

    def move(self, centres_m: Floats) -> None:
        """Put the middles of what moves at (M, 2) on the floor's plane; heights and turns stay."""
        self._data.mocap_pos[:, :2] = centres_m
        self._mujoco.mj_kinematics(self._model, self._data)
        first = len(self.centres_m) - self.moving
        self.centres_m[first:] = self._data.geom_xpos[first:]
        self.solids[first - 1 :, 1:4] = self.centres_m[first:]

    def cast(self, origin_m: Floats, directions: Floats, cutoff_m: float) -> tuple[Floats, NDArray[np.int32], Floats]:
        """Follow rays from one point.

        Args:
            origin_m: (3,).
            directions: (N, 3) unit vectors.
            cutoff_m: what is farther than this is not met.

        Returns:
            (N,) distance, (N,) int32 index of the geom and (N, 3) unit normal of its surface; inf, -1 and anything
            where the ray met nothing.
        """
        count = len(directions)
        distance_m, geom, normal = np.empty(count), np.empty(count, np.int32), np.empty(3 * count)
        vectors = np.ascontiguousarray(directions).ravel()
        self._mujoco.mj_multiRay(
            self._model, self._data, origin_m, vectors, None, True, -1, geom, distance_m, normal, count, cutoff_m
        )
        nothing = (geom < 0) | (distance_m > cutoff_m)
        distance_m[nothing], geom[nothing] = np.inf, -1
        return distance_m, geom, normal.reshape(-1, 3)

    def into_frame(self, geom: NDArray[np.int32], vectors: Floats) -> Floats:
        """(N, 3) vectors as they are along the axes of the geoms (N,)."""
        cos, sin, up = self.turns[geom].T
        x, y, z = vectors.T
        return np.stack([cos * x + sin * y, cos * y - sin * x, up * z], 1)

    def _solid(self, geom: int, shape: Shape) -> list[float]:
        turn = [1.0, 0.0, 1.0] if shape.kind == "ball" else self.turns[geom].tolist()
        return [KINDS.index(shape.kind), *self.centres_m[geom].tolist(), *turn, *shape.half_m]

    def _compile(self, layout: Layout, moving: Sequence[Shape]) -> Any:
        spec = self._mujoco.MjSpec()
        arena = layout.scenario.arena
        half = [arena.length_m / 2, arena.width_m / 2, 0.1]  # the last is how densely a plane would be drawn: unused
        spec.worldbody.add_geom(type=self._mujoco.mjtGeom.mjGEOM_PLANE, size=half)
        for shape in layout.shapes:
            kind, size, turn = self._form(shape)
            spec.worldbody.add_geom(type=kind, size=size, pos=list(shape.centre_m), quat=turn)
        for shape in moving:
            kind, size, turn = self._form(shape)
            body = spec.worldbody.add_body(mocap=True, pos=list(shape.centre_m), quat=turn)
            body.add_geom(type=kind, size=size)
        return spec.compile()

    def _form(self, shape: Shape) -> tuple[Any, list[float], list[float]]:
        """MuJoCo's name of the kind, its size and its turn as a quaternion."""
        kinds, (x, y, z) = self._mujoco.mjtGeom, shape.half_m
        kind, size = {
            "box": (kinds.mjGEOM_BOX, [x, y, z]),
            "cylinder": (kinds.mjGEOM_CYLINDER, [x, z, 0.0]),
            "ball": (kinds.mjGEOM_SPHERE, [x, 0.0, 0.0]),
        }[shape.kind]
        return kind, size, [np.cos(shape.yaw_rad / 2), 0.0, 0.0, np.sin(shape.yaw_rad / 2)]


def turned(vectors: Floats, cos: float, sin: float) -> Floats:
    """(..., 3) vectors of the robot's frame, seen from the arena: turned about the vertical."""
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    return np.stack([x * cos - y * sin, x * sin + y * cos, z], -1)


def _import_mujoco() -> Any:
    """MuJoCo, imported where it is used: a robot that is not simulated does without it."""
    try:
        import mujoco
    except ImportError as error:
        raise ImportError(f"the simulated robot needs MuJoCo: {install('sim')}") from error
    return mujoco
