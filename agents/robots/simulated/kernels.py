"""The compiled rays of the simulated robot: the pictures of `camera.py` and the ranges of `proximity.py`, bit for bit.

MuJoCo follows every ray on its own. Here most of that work falls away, because the camera's height and tilt are fixed
and nothing stands but upright boxes, cylinders and balls: where a pixel's ray meets the floor is a constant of the
optics, a solid is looked for only in the pixels that its outline may cover, and between a point and the lamp only those
that throw their shadow there (`lamp.py`). What is left is computed as MuJoCo and numpy compute it, in their order.

A solid is a row of `World.solids`, and so is what a geom looks like a row of `surfaces`, with columns as below. Geom 0
is the floor, geom i solid i - 1.
"""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np

from functools import partial
from replay.compiling import jit as _jit
jit = partial(_jit, error_model='numpy', forceinline=True)

KIND, X, Y, Z, COS, SIN, UP, HALF_X, HALF_Y, HALF_Z = range(10)  # of a solid
PERIOD, TINT = 0, 7  # of a surface, whose X to UP are those of its solid
BOX, CYLINDER = 0, 1
ACROSS_X, ACROSS_Y, ACROSS_Z, ROUND, BACK = 0, 1, 2, 3, 4  # the side that is met; + BACK: its normal looks to minus

_TINY = 1e-15  # MuJoCo takes what is smaller for zero
_NEAR_M = 1e-9  # in front of the camera's plane; what is nearer cannot be projected

Vector = tuple[float, float, float]
_VECTOR = "UniTuple(float64, 3)"


def build() -> SimpleNamespace:
    """`picture` and `nearest`, described below."""
    into_frame, meet = _meeting()
    see, normal_at = _seeing(into_frame, meet)
    shade = _shading(normal_at, _colouring(into_frame), _lighting(into_frame, meet))
    return SimpleNamespace(picture=_picturing(see, shade), nearest=_feeling(into_frame, meet))


def _meeting() -> Any:
    """`into_frame(row, vector)`: along the axes of a solid or geom.

    `meet(solid, point, ray)`, in its frame: distance, or -1, and the side.
    """

    @jit(f"{_VECTOR}(float64[::1], {_VECTOR})")
    def into_frame(row: Any, vector: Vector) -> Vector:
        x, y, z = vector
        return row[COS] * x + row[SIN] * y, row[COS] * y - row[SIN] * x, row[UP] * z

    @jit("UniTuple(float64, 2)(float64, float64, float64)")
    def crossings(half: float, point: float, ray: float) -> tuple[float, float]:
        """Where a ray enters and leaves the slab between -half and half."""
        if abs(ray) <= _TINY:
            return (-math.inf, math.inf) if abs(point) <= half else (math.inf, -math.inf)
        low, high = (-half - point) / ray, (half - point) / ray
        return (low, high) if ray > 0 else (high, low)

    @jit(f"Tuple((float64, int64))(float64[::1], {_VECTOR}, {_VECTOR})")
    def meet_box(solid: Any, point: Vector, ray: Vector) -> tuple[float, int]:
        enter, leave, enter_side, leave_side = -math.inf, math.inf, 0, 0
        for axis in range(3):
            low, high = crossings(solid[HALF_X + axis], point[axis], ray[axis])
            back_first = BACK if ray[axis] > 0 else 0
            if low > enter:
                enter, enter_side = low, axis + back_first
            if high < leave:
                leave, leave_side = high, axis + BACK - back_first
            if enter > leave or leave < 0:
                return -1.0, 0
        return (enter, enter_side) if enter >= 0 else (leave, leave_side)

    @jit("float64(float64, float64, float64)")
    def first_root(a: float, b: float, c: float) -> float:
        """The smallest x >= 0 with a x^2 + 2 b x + c = 0, or -1."""
        inside = b * b - a * c
        if inside < _TINY:
            return -1.0
        root = math.sqrt(inside)
        first, second = (-b - root) / a, (-b + root) / a
        if first >= 0:
            return first
        return second if second >= 0 else -1.0

    @jit(f"Tuple((float64, int64))(float64[::1], {_VECTOR}, {_VECTOR})")
    def meet_cylinder(solid: Any, point: Vector, ray: Vector) -> tuple[float, int]:
        (px, py, pz), (rx, ry, rz) = point, ray
        radius_squared, half = solid[HALF_X] * solid[HALF_X], solid[HALF_Z]
        distance, side = -1.0, 0
        if abs(rz) > _TINY:
            for sign in (-1.0, 1.0):
                lid = (sign * half - pz) / rz
                if lid >= 0 and (distance < 0 or lid < distance):
                    x, y = px + lid * rx, py + lid * ry
                    if x * x + y * y <= radius_squared:
                        distance, side = lid, ACROSS_Z if sign > 0 else ACROSS_Z + BACK
        mantle = first_root(rx * rx + ry * ry, rx * px + ry * py, px * px + py * py - radius_squared)
        if mantle >= 0 and abs(pz + mantle * rz) <= half and (distance < 0 or mantle < distance):
            distance, side = mantle, ROUND
        return distance, side

    @jit(f"Tuple((float64, int64))(float64[::1], {_VECTOR}, {_VECTOR})")
    def meet(solid: Any, point: Vector, ray: Vector) -> tuple[float, int]:
        if solid[KIND] == BOX:
            return meet_box(solid, point, ray)
        if solid[KIND] == CYLINDER:
            return meet_cylinder(solid, point, ray)
        (px, py, pz), (rx, ry, rz) = point, ray
        outside = px * px + py * py + pz * pz - solid[HALF_X] * solid[HALF_X]
        return first_root(rx * rx + ry * ry + rz * rz, rx * px + ry * py + rz * pz, outside), ROUND

    return into_frame, meet


def _seeing(into_frame: Any, meet: Any) -> Any:
    """`see(eye, lens, directions, floor_m, solids, distance_m, geom, side)`: fills the last three, a value a pixel.

    `normal_at(eye, solid, side, ray, point, distance_m)`: of the surface there.
    """

    @jit("UniTuple(int64, 4)(float64[::1], float64[::1], float64[::1])")
    def outline(solid: Any, eye: Any, lens: Any) -> tuple[int, int, int, int]:
        """First and last row, first and last column of the pixels that may see it."""
        focal, cos_pitch, sin_pitch, middle_x, middle_y = lens[0], lens[1], lens[2], lens[3], lens[4]
        depth, right, down = np.empty(8), np.empty(8), np.empty(8)  # its corners, from the camera
        for corner in range(8):
            x = solid[HALF_X] if corner & 1 else -solid[HALF_X]
            y = solid[HALF_Y] if corner & 2 else -solid[HALF_Y]
            z = solid[HALF_Z] if corner & 4 else -solid[HALF_Z]
            east = solid[X] + solid[COS] * x - solid[SIN] * y - eye[0]
            north = solid[Y] + solid[SIN] * x + solid[COS] * y - eye[1]
            up = solid[Z] + z - eye[2]
            ahead = east * eye[3] + north * eye[4]
            depth[corner] = ahead * cos_pitch - up * sin_pitch
            right[corner] = east * eye[4] - north * eye[3]
            down[corner] = -ahead * sin_pitch - up * cos_pitch
        west, east, north, south = math.inf, -math.inf, math.inf, -math.inf
        for corner in range(8):
            for axis in range(4):
                # A corner ahead counts itself; for one behind count the places where its edges come before the camera.
                other, share = corner ^ (1 << axis), 0.0
                if depth[corner] < _NEAR_M:
                    if axis == 3 or depth[other] <= _NEAR_M:
                        continue
                    share = (_NEAR_M - depth[corner]) / (depth[other] - depth[corner])
                elif axis < 3:
                    continue
                else:
                    other = corner
                scale = focal / max(depth[corner], _NEAR_M)
                across = middle_x + scale * (right[corner] + share * (right[other] - right[corner]))
                along = middle_y + scale * (down[corner] + share * (down[other] - down[corner]))
                west, east = min(west, across), max(east, across)
                north, south = min(north, along), max(south, along)
        # Pixel i is seen through i + 0.5. Whole pixels outwards, so that rounding hides nothing.
        return (
            int(math.floor(min(max(north - 0.5, 0.0), 2 * middle_y))),
            int(math.ceil(min(max(south - 0.5, -1.0), 2 * middle_y - 1))),
            int(math.floor(min(max(west - 0.5, 0.0), 2 * middle_x))),
            int(math.ceil(min(max(east - 0.5, -1.0), 2 * middle_x - 1))),
        )

    @jit(
        "void(float64[::1], float64[::1], float64[:, ::1], float64[::1], float64[:, ::1],"
        " float64[::1], int32[::1], int8[::1])"
    )
    def see(
        eye: Any, lens: Any, directions: Any, floor_m: Any, solids: Any, distance_m: Any, geom: Any, side: Any
    ) -> None:
        cos, sin, width, sight_m = eye[3], eye[4], int(2 * lens[3]), lens[6]
        for pixel in range(len(directions)):
            forward, leftward = directions[pixel, 0], directions[pixel, 1]
            x = eye[0] + (forward * cos - leftward * sin) * floor_m[pixel]
            y = eye[1] + (forward * sin + leftward * cos) * floor_m[pixel]
            on_floor = abs(x) <= lens[8] and abs(y) <= lens[9]
            distance_m[pixel] = floor_m[pixel] if on_floor else math.inf
            geom[pixel] = 0 if on_floor else -1
            side[pixel] = ACROSS_Z
        for index in range(len(solids)):
            solid = solids[index]
            first_row, last_row, first_column, last_column = outline(solid, eye, lens)
            point = into_frame(solid, (eye[0] - solid[X], eye[1] - solid[Y], eye[2] - solid[Z]))
            for row in range(first_row, last_row + 1):
                for pixel in range(row * width + first_column, row * width + last_column + 1):
                    forward, leftward = directions[pixel, 0], directions[pixel, 1]
                    x, y = forward * cos - leftward * sin, forward * sin + leftward * cos
                    met_m, met_side = meet(solid, point, into_frame(solid, (x, y, directions[pixel, 2])))
                    if 0 <= met_m < distance_m[pixel] and met_m <= sight_m:
                        distance_m[pixel], geom[pixel], side[pixel] = met_m, index + 1, met_side

    @jit(f"{_VECTOR}(float64[::1], float64[::1], int64, {_VECTOR}, {_VECTOR}, float64)")
    def normal_at(eye: Any, solid: Any, side: int, ray: Vector, point: Vector, distance_m: float) -> Vector:
        if side == ROUND and solid[KIND] == CYLINDER:
            px, py, _ = into_frame(solid, (eye[0] - solid[X], eye[1] - solid[Y], eye[2] - solid[Z]))
            rx, ry, _ = into_frame(solid, ray)
            x, y = px + distance_m * rx, py + distance_m * ry
            inverse = 1 / math.sqrt(x * x + y * y)
            x, y = x * inverse, y * inverse
            return solid[COS] * x - solid[SIN] * y, solid[SIN] * x + solid[COS] * y, 0.0
        if side == ROUND:
            x, y, z = point[0] - solid[X], point[1] - solid[Y], point[2] - solid[Z]
            inverse = 1 / math.sqrt(x * x + y * y + z * z)
            return x * inverse, y * inverse, z * inverse
        sign = 1.0 if side < BACK else -1.0
        axis = side % BACK
        if axis == ACROSS_X:
            return sign * solid[COS], sign * solid[SIN], 0.0
        if axis == ACROSS_Y:
            return -sign * solid[SIN], sign * solid[COS], 0.0
        return 0.0, 0.0, sign * solid[UP]

    return see, normal_at


def _colouring(into_frame: Any) -> Any:
    """`texel(surface, start, level_start, halfway, point, normal, pixel_m)`: where its colour is; see `MipMaps`."""

    @jit(f"int64(float64[::1], int64, int64[::1], float64[::1], {_VECTOR}, {_VECTOR}, float64)")
    def texel(
        surface: Any, start: int, level_start: Any, halfway: Any, point: Vector, normal: Vector, pixel_m: float
    ) -> int:
        x, y, z = into_frame(surface, (point[0] - surface[X], point[1] - surface[Y], point[2] - surface[Z]))
        facing_x, facing_y, facing_z = into_frame(surface, normal)
        if abs(facing_x) >= abs(facing_y) and abs(facing_x) >= abs(facing_z):
            u, v = y, z
        elif abs(facing_y) >= abs(facing_z):
            u, v = x, z
        else:
            u, v = x, y
        levels, level = len(halfway), 0
        texels = pixel_m * (1 << levels) / surface[PERIOD]
        while level < levels and texels >= halfway[level]:
            level += 1
        size = 1 << (levels - level)
        column = int(math.floor(u / surface[PERIOD] * size)) & (size - 1)
        row = int(math.floor(v / surface[PERIOD] * size)) & (size - 1)
        return start + level_start[level] + row * size + column

    return texel


def _lighting(into_frame: Any, meet: Any) -> Any:
    """`share(lamp, solids, from_lamp, grid, start, members, point, normal)`: see `Lamp.share`."""

    @jit(f"int64(float64[::1], float64[::1], {_VECTOR})")
    def cell(lamp: Any, grid: Any, point: Vector) -> int:
        """Of the shadow map."""
        x, y, z = point
        cells = int(grid[4])
        if z < lamp[2] - lamp[3]:
            onward = lamp[2] / (lamp[2] - z)
            column = (lamp[0] + (x - lamp[0]) * onward - grid[0]) * grid[2]
            row = (lamp[1] + (y - lamp[1]) * onward - grid[1]) * grid[3]
            if 0 <= column < cells and 0 <= row < cells:
                return int(row) * cells + int(column)
        return cells * cells

    @jit(
        f"float64(float64[::1], float64[:, ::1], float64[:, ::1], float64[::1], int32[::1], int32[::1],"
        f" {_VECTOR}, {_VECTOR})"
    )
    def share(
        lamp: Any, solids: Any, from_solids: Any, grid: Any, start: Any, members: Any, point: Vector, normal: Vector
    ) -> float:
        x, y, z = point[0] - lamp[0], point[1] - lamp[1], point[2] - lamp[2]
        reach = math.sqrt(x * x + y * y + z * z)
        x, y, z = x / reach, y / reach, z / reach
        facing = -(x * normal[0] + y * normal[1] + z * normal[2])
        if facing <= 0:
            return 0.0
        here = cell(lamp, grid, point)
        for entry in range(start[here], start[here + 1]):
            index = members[entry]
            lamp_there = from_solids[index, 0], from_solids[index, 1], from_solids[index, 2]
            first, _ = meet(solids[index], lamp_there, into_frame(solids[index], (x, y, z)))
            if 0 <= first < reach - lamp[3]:
                return 0.0
        return facing

    return share


def _shading(normal_at: Any, texel: Any, share: Any) -> Any:
    """`shade(...)`: fills the colours of what was seen."""

    @jit(
        "void(float64[::1], float64[::1], float64[:, ::1], float64[:, ::1], float64[:, ::1],"
        " int64[::1], float32[:, ::1], int64[::1], float64[::1],"
        " float64[::1], float64[:, ::1], float64[::1], int32[::1], int32[::1], float64[::1],"
        " float64[::1], int32[::1], int8[::1], uint8[:, ::1])"
    )
    def shade(
        eye: Any,
        lens: Any,
        directions: Any,
        solids: Any,
        surfaces: Any,
        texture_start: Any,
        texels: Any,
        level_start: Any,
        halfway: Any,
        lamp: Any,
        from_solids: Any,
        grid: Any,
        start: Any,
        members: Any,
        beyond: Any,
        distance_m: Any,
        geom: Any,
        side: Any,
        picture: Any,
    ) -> None:
        cos, sin, pixel_rad, steepest = eye[3], eye[4], lens[5], lens[7]
        for pixel in range(len(directions)):
            met, far_m = geom[pixel], distance_m[pixel]
            if met < 0:
                for channel in range(3):
                    picture[pixel, channel] = np.uint8(beyond[channel])
                continue
            forward, leftward, up = directions[pixel, 0], directions[pixel, 1], directions[pixel, 2]
            ray = forward * cos - leftward * sin, forward * sin + leftward * cos, up
            point = eye[0] + ray[0] * far_m, eye[1] + ray[1] * far_m, eye[2] + ray[2] * far_m
            if met:
                normal = normal_at(eye, solids[met - 1], side[pixel], ray, point, far_m)
            else:
                normal = 0.0, 0.0, 1.0
            slant = -(ray[0] * normal[0] + ray[1] * normal[1] + ray[2] * normal[2])
            pixel_m = far_m * pixel_rad / math.sqrt(min(max(slant, steepest), 1.0))
            row = texel(surfaces[met], texture_start[met], level_start, halfway, point, normal, pixel_m)
            lit = share(lamp, solids, from_solids, grid, start, members, point, normal)
            for channel in range(3):
                colour = texels[row, channel] * surfaces[met, TINT] * (lamp[4] + lit * lamp[5 + channel])
                picture[pixel, channel] = np.uint8(min(max(colour, 0.0), 255.0))

    return shade


def _picturing(see: Any, shade: Any) -> Any:
    """`picture(eye, ...)`: fills the last argument; the others are as `camera._scene` lists them."""

    @jit(
        "void(float64[::1], float64[::1], float64[:, ::1], float64[::1], float64[:, ::1], float64[:, ::1],"
        " int64[::1], float32[:, ::1], int64[::1], float64[::1],"
        " float64[::1], float64[:, ::1], float64[::1], int32[::1], int32[::1], float64[::1], uint8[:, ::1])"
    )
    def picture(
        eye: Any,
        lens: Any,
        directions: Any,
        floor_m: Any,
        solids: Any,
        surfaces: Any,
        texture_start: Any,
        texels: Any,
        level_start: Any,
        halfway: Any,
        lamp: Any,
        from_solids: Any,
        grid: Any,
        start: Any,
        members: Any,
        beyond: Any,
        pixels: Any,
    ) -> None:
        count = len(directions)
        distance_m, geom, side = np.empty(count), np.empty(count, np.int32), np.empty(count, np.int8)
        see(eye, lens, directions, floor_m, solids, distance_m, geom, side)
        shade(
            eye, lens, directions, solids, surfaces, texture_start, texels, level_start, halfway,
            lamp, from_solids, grid, start, members, beyond, distance_m, geom, side, pixels,
        )  # fmt: skip

    return picture


def _feeling(into_frame: Any, meet: Any) -> Any:
    """`nearest(x_m, y_m, cos, sin, origins_m, rays, solids, cutoff_m, found_m)`: fills the last; see `Proximity`."""

    @jit(
        "void(float64, float64, float64, float64, float64[:, ::1], float64[:, :, ::1], float64[:, ::1], float64,"
        " float64[::1])"
    )
    def nearest(
        x_m: float,
        y_m: float,
        cos: float,
        sin: float,
        origins_m: Any,
        rays: Any,
        solids: Any,
        cutoff_m: float,
        found_m: Any,
    ) -> None:
        for beam in range(len(origins_m)):
            found_m[beam] = math.inf
            x = x_m + (origins_m[beam, 0] * cos - origins_m[beam, 1] * sin)
            y = y_m + (origins_m[beam, 0] * sin + origins_m[beam, 1] * cos)
            for index in range(len(solids)):
                solid = solids[index]
                dx, dy, dz = x - solid[X], y - solid[Y], origins_m[beam, 2] - solid[Z]
                if max(abs(dx), abs(dy)) > cutoff_m + solid[HALF_X] + solid[HALF_Y]:
                    continue
                point = into_frame(solid, (dx, dy, dz))
                for ray in range(rays.shape[1]):
                    forward, leftward, up = rays[beam, ray, 0], rays[beam, ray, 1], rays[beam, ray, 2]
                    direction = forward * cos - leftward * sin, forward * sin + leftward * cos, up
                    met_m, _ = meet(solid, point, into_frame(solid, direction))
                    if 0 <= met_m < found_m[beam] and met_m <= cutoff_m:
                        found_m[beam] = met_m

    return nearest
