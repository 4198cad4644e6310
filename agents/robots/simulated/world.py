"""The arena as a MuJoCo scene: the one place where rays meet shapes. Nothing moves in it, and no GL is needed.

The robot is not part of the scene: its camera and its sensors look outwards from its rim, so it never sees itself.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.robots.simulated.layout import Layout, Shape
from agents.robots.simulated.scenario import Surface

Floats = NDArray[np.float64]
FLOOR = 0  # MuJoCo keeps the order in which geoms were added; the floor is the first


class World:
    """Casts rays into a layout. `surfaces` and `tints` tell, by the geom a ray met, what it looks like there."""

    def __init__(self, layout: Layout) -> None:
        self._mujoco = _import_mujoco()
        self._model = self._compile(layout)
        self._data = self._mujoco.MjData(self._model)
        self._mujoco.mj_forward(self._model, self._data)
        floor = layout.scenario.surface_named(layout.scenario.arena.floor)
        self.surfaces: list[Surface] = [floor, *(shape.surface for shape in layout.shapes)]
        self.tints: Floats = np.array([1.0, *(shape.tint for shape in layout.shapes)])
        self.centres_m: Floats = self._data.geom_xpos.copy()  # (G, 3)
        self.axes: Floats = self._data.geom_xmat.reshape(-1, 3, 3).copy()  # (G, 3, 3), columns: each geom's own axes

    def cast(self, origin_m: Floats, directions: Floats, cutoff_m: float) -> tuple[Floats, NDArray[np.int32], Floats]:
        """Follow rays from one point.

        Args:
            origin_m: (3,).
            directions: (N, 3) unit vectors.
            cutoff_m: shapes that are altogether farther than this are not looked for.

        Returns:
            (N,) distance, (N,) int32 index of the geom and (N, 3) unit normal of its surface; -1, -1 and anything
            where the ray met nothing.
        """
        count = len(directions)
        distance_m, geom, normal = np.empty(count), np.empty(count, np.int32), np.empty(3 * count)
        vectors = np.ascontiguousarray(directions).ravel()
        self._mujoco.mj_multiRay(
            self._model, self._data, origin_m, vectors, None, True, -1, geom, distance_m, normal, count, cutoff_m
        )
        return distance_m, geom, normal.reshape(-1, 3)

    def _compile(self, layout: Layout) -> Any:
        spec = self._mujoco.MjSpec()
        arena = layout.scenario.arena
        half = [arena.length_m / 2, arena.width_m / 2, 0.1]  # the last is how densely a plane would be drawn: unused
        spec.worldbody.add_geom(type=self._mujoco.mjtGeom.mjGEOM_PLANE, size=half)
        for shape in layout.shapes:
            self._add(spec, shape)
        return spec.compile()

    def _add(self, spec: Any, shape: Shape) -> None:
        kinds, (x, y, z) = self._mujoco.mjtGeom, shape.half_m
        kind, size = {
            "box": (kinds.mjGEOM_BOX, [x, y, z]),
            "cylinder": (kinds.mjGEOM_CYLINDER, [x, z, 0.0]),
            "ball": (kinds.mjGEOM_SPHERE, [x, 0.0, 0.0]),
        }[shape.kind]
        turn = [np.cos(shape.yaw_rad / 2), 0.0, 0.0, np.sin(shape.yaw_rad / 2)]
        spec.worldbody.add_geom(type=kind, size=size, pos=list(shape.centre_m), quat=turn)


def _import_mujoco() -> Any:
    """MuJoCo, imported where it is used: a robot that is not simulated does without it."""
    try:
        import mujoco
    except ImportError as error:
        raise ImportError("the simulated robot needs MuJoCo: pip install 'llrp-online[sim]'") from error
    return mujoco
