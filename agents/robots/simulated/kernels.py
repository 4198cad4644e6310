"""The compiled rays of the simulated robot: the pictures of `camera.py` and the ranges of `proximity.py`, bit for bit.

MuJoCo follows every ray on its own. Here most of that work falls away, because the camera's height and tilt are fixed
and nothing stands but upright boxes, cylinders and balls: where a pixel's ray meets the floor is a constant of the
optics, a solid is looked for only in the pixels that its outline may cover, and between a point and the lamp only those
that throw their shadow there (`lamp.py`). What is left is computed as MuJoCo and numpy compute it, in their order.

A solid is a row of `World.solids`; geom 0 is the floor, and geom i is solid i - 1. All arrays are laid out as
`camera.py` and `lamp.py` say, with the columns named here. One long file, because numba's cache looks at a kernel's own
file only.
"""

import math
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np

from replay.compiling import jit

KIND, X, Y, Z, COS, SIN, UP, HALF_X, HALF_Y, HALF_Z = range(10)  # of a solid
PERIOD_M, TINT = 0, 7  # of a surface; its X to UP are those of its geom
FOCAL, COS_PITCH, SIN_PITCH, MIDDLE_X, MIDDLE_Y, PIXEL_RAD, SIGHT_M, STEEPEST, FLOOR_X, FLOOR_Y, BEYOND = range(11)
LAMP_X, LAMP_Y, LAMP_Z, SLACK_M, AMBIENT, LAMP_RED = range(6)
GRID_X, GRID_Y, CELLS_A_METRE_X, CELLS_A_METRE_Y, CELLS = range(5)

BOX, CYLINDER = 0, 1
ACROSS_X, ACROSS_Y, ACROSS_Z, ROUND, BACK = range(5)  # the side that is met; + BACK: its normal looks to minus

_TINY = 1e-15  # MuJoCo takes what is smaller for zero
_NEAR_M = 1e-9  # in front of the camera's plane; what is nearer cannot be projected

Vector = tuple[float, float, float]
Eye = tuple[float, float, float, float, float]  # x, y, z, and cosine and sine of the yaw
_VECTOR, _EYE = "UniTuple(float64, 3)", "UniTuple(float64, 5)"
_ROW, _ROWS, _SOME = "float64[::1]", "float64[:, ::1]", "int32[::1]"
_OPTICS = f"Tuple(({_ROW}, {_ROWS}, {_ROW}))"  # numbers, directions, distance of the floor
_TEXTURES = f"Tuple(({_ROWS}, int64[::1], float32[:, ::1], int64[::1], {_ROW}))"  # see `MipMaps`
_LAMP = f"Tuple(({_ROW}, {_ROWS}, {_ROW}, {_SOME}, {_SOME}))"  # numbers, and see `ShadowMap`

# Nothing here divides by zero unless infinity is meant; and most of these functions do less than a call costs.
_kernel = partial(jit, error_model="numpy", forceinline=True)


def build() -> SimpleNamespace:
    """`picture` and `nearest`, described below."""
    into_frame, meet = _meeting()
    seeing = _seeing(into_frame, meet, _outlining())
    picture = _picturing(seeing, _normals(into_frame), _colouring(into_frame), _lighting(into_frame, meet))
    return SimpleNamespace(picture=picture, nearest=_feeling(into_frame, meet))


def _meeting() -> Any:
    """`into_frame(row, vector)`: along the axes of a solid or geom.

    `meet(solid, point, ray)`, in its frame: distance, or -1, and the side.
    """

    @_kernel(f"{_VECTOR}({_ROW}, {_VECTOR})")
    def into_frame(row: Any, vector: Vector) -> Vector:
        x, y, z = vector
        return row[COS] * x + row[SIN] * y, row[COS] * y - row[SIN] * x, row[UP] * z

    @_kernel("UniTuple(float64, 2)(float64, float64, float64)")
    def crossings(half: float, point: float, ray: float) -> tuple[float, float]:
        """Where a ray enters and leaves the slab between -half and half."""
        if abs(ray) <= _TINY:
            return (-math.inf, math.inf) if abs(point) <= half else (math.inf, -math.inf)
        low, high = (-half - point) / ray, (half - point) / ray
        return (low, high) if ray > 0 else (high, low)

    @_kernel(f"Tuple((float64, int64))({_ROW}, {_VECTOR}, {_VECTOR})")
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
        if enter == leave and leave_side % BACK < enter_side % BACK:  # it grazes an edge: MuJoCo's first axis wins
            return leave, leave_side
        return (enter, enter_side) if enter >= 0 else (leave, leave_side)

    @_kernel("float64(float64, float64, float64)")
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

    @_kernel(f"Tuple((float64, int64))({_ROW}, {_VECTOR}, {_VECTOR})")
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

    @_kernel(f"Tuple((float64, int64))({_ROW}, {_VECTOR}, {_VECTOR})")
    def meet(solid: Any, point: Vector, ray: Vector) -> tuple[float, int]:
        if solid[KIND] == BOX:
            return meet_box(solid, point, ray)
        if solid[KIND] == CYLINDER:
            return meet_cylinder(solid, point, ray)
        (px, py, pz), (rx, ry, rz) = point, ray
        outside = px * px + py * py + pz * pz - solid[HALF_X] * solid[HALF_X]
        return first_root(rx * rx + ry * ry + rz * rz, rx * px + ry * py + rz * pz, outside), ROUND

    return into_frame, meet


def _outlining() -> Any:
    """`outline(solid, eye, point, lens)`: first and last row, first and last column of the pixels that may see it.

    `point` is the eye in the solid's frame.
    """

    @_kernel(f"void({_ROW}, {_EYE}, {_ROW}, {_ROWS})")
    def place_corners(solid: Any, eye: Eye, lens: Any, corners: Any) -> None:
        """Ahead of the camera, to its right and down."""
        x, y, z, cos, sin = eye
        for corner in range(8):
            along_x = solid[HALF_X] if corner & 1 else -solid[HALF_X]
            along_y = solid[HALF_Y] if corner & 2 else -solid[HALF_Y]
            along_z = solid[HALF_Z] if corner & 4 else -solid[HALF_Z]
            east = solid[X] + solid[COS] * along_x - solid[SIN] * along_y - x
            north = solid[Y] + solid[SIN] * along_x + solid[COS] * along_y - y
            up, ahead = solid[Z] + along_z - z, east * cos + north * sin
            corners[corner, 0] = ahead * lens[COS_PITCH] - up * lens[SIN_PITCH]
            corners[corner, 1] = east * sin - north * cos
            corners[corner, 2] = -ahead * lens[SIN_PITCH] - up * lens[COS_PITCH]

    @_kernel(f"UniTuple(int64, 4)({_ROW}, {_EYE}, {_VECTOR}, {_ROW})")
    def outline(solid: Any, eye: Eye, point: Vector, lens: Any) -> tuple[int, int, int, int]:
        middle_x, middle_y = lens[MIDDLE_X], lens[MIDDLE_Y]
        x_m, y_m, z_m = abs(point[0]) - solid[HALF_X], abs(point[1]) - solid[HALF_Y], abs(point[2]) - solid[HALF_Z]
        if max(x_m, y_m, z_m) <= _NEAR_M:  # within it, or on its surface
            return 0, int(2 * middle_y) - 1, 0, int(2 * middle_x) - 1
        corners = np.empty((8, 3))
        place_corners(solid, eye, lens, corners)
        left, right, top, bottom = math.inf, -math.inf, math.inf, -math.inf
        for corner in range(8):
            # A corner ahead counts itself; for one behind count the places where its edges come before the camera.
            depth = corners[corner, 0]
            behind = depth < _NEAR_M
            for edge in range(3 if behind else 1):
                other, share = corner ^ (1 << edge), 0.0
                if behind:
                    if corners[other, 0] <= _NEAR_M:
                        continue
                    share = (_NEAR_M - depth) / (corners[other, 0] - depth)
                scale = lens[FOCAL] / max(depth, _NEAR_M)
                x = scale * (corners[corner, 1] + share * (corners[other, 1] - corners[corner, 1]))
                y = scale * (corners[corner, 2] + share * (corners[other, 2] - corners[corner, 2]))
                left, right, top, bottom = min(left, x), max(right, x), min(top, y), max(bottom, y)
        # Pixel i is seen through i + 0.5. Whole pixels outwards, so that rounding hides nothing.
        return (
            math.floor(min(max(middle_y + top - 0.5, 0.0), 2 * middle_y)),
            math.ceil(min(max(middle_y + bottom - 0.5, -1.0), 2 * middle_y - 1)),
            math.floor(min(max(middle_x + left - 0.5, 0.0), 2 * middle_x)),
            math.ceil(min(max(middle_x + right - 0.5, -1.0), 2 * middle_x - 1)),
        )

    return outline


def _seeing(into_frame: Any, meet: Any, outline: Any) -> Any:
    """`see(eye, optics, solids, distance_m, geom, side)`: fills the last three, a value a pixel; geom -1 is nothing."""

    @_kernel(f"void({_EYE}, {_OPTICS}, {_ROWS}, {_ROW}, {_SOME}, int8[::1])")
    def see(eye: Eye, optics: Any, solids: Any, distance_m: Any, geom: Any, side: Any) -> None:
        lens, directions, floor_m = optics
        eye_x, eye_y, eye_z, cos, sin = eye
        width = int(2 * lens[MIDDLE_X])
        for pixel in range(len(directions)):
            ahead, left = directions[pixel, 0], directions[pixel, 1]
            x = eye_x + (ahead * cos - left * sin) * floor_m[pixel]
            y = eye_y + (ahead * sin + left * cos) * floor_m[pixel]
            on_floor = abs(x) <= lens[FLOOR_X] and abs(y) <= lens[FLOOR_Y]
            distance_m[pixel] = floor_m[pixel] if on_floor else math.inf
            geom[pixel] = 0 if on_floor else -1
            side[pixel] = ACROSS_Z
        for index in range(len(solids)):
            solid = solids[index]
            point = into_frame(solid, (eye_x - solid[X], eye_y - solid[Y], eye_z - solid[Z]))
            top, bottom, leftmost, rightmost = outline(solid, eye, point, lens)
            for row in range(top, bottom + 1):
                for pixel in range(row * width + leftmost, row * width + rightmost + 1):
                    ahead, left = directions[pixel, 0], directions[pixel, 1]
                    ray = ahead * cos - left * sin, ahead * sin + left * cos, directions[pixel, 2]
                    met_m, met_side = meet(solid, point, into_frame(solid, ray))
                    if 0 <= met_m < distance_m[pixel] and met_m <= lens[SIGHT_M]:
                        distance_m[pixel], geom[pixel], side[pixel] = met_m, index + 1, met_side

    return see


def _normals(into_frame: Any) -> Any:
    """`normal_at(eye, solid, side, ray, point, distance_m)`: of the surface there, outwards."""

    @_kernel(f"{_VECTOR}({_EYE}, {_ROW}, int64, {_VECTOR}, {_VECTOR}, float64)")
    def normal_at(eye: Eye, solid: Any, side: int, ray: Vector, point: Vector, distance_m: float) -> Vector:
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
        if side % BACK == ACROSS_X:
            return sign * solid[COS], sign * solid[SIN], 0.0
        if side % BACK == ACROSS_Y:
            return -sign * solid[SIN], sign * solid[COS], 0.0
        return 0.0, 0.0, sign * solid[UP]

    return normal_at


def _colouring(into_frame: Any) -> Any:
    """`texel(textures, geom, point, normal, pixel_m)`: the row of its colour; see `MipMaps.colours`."""

    @_kernel(f"int64({_TEXTURES}, int64, {_VECTOR}, {_VECTOR}, float64)")
    def texel(textures: Any, geom: int, point: Vector, normal: Vector, pixel_m: float) -> int:
        surfaces, starts, _, level_starts, halfway = textures
        surface = surfaces[geom]
        x, y, z = into_frame(surface, (point[0] - surface[X], point[1] - surface[Y], point[2] - surface[Z]))
        facing_x, facing_y, facing_z = into_frame(surface, normal)
        if abs(facing_x) >= abs(facing_y) and abs(facing_x) >= abs(facing_z):
            u, v = y, z
        elif abs(facing_y) >= abs(facing_z):
            u, v = x, z
        else:
            u, v = x, y
        period_m = surface[PERIOD_M]
        levels, level = len(halfway), 0
        texels = pixel_m * (1 << levels) / period_m
        while level < levels and texels >= halfway[level]:
            level += 1
        size = 1 << (levels - level)
        column = math.floor(u / period_m * size) & (size - 1)
        row = math.floor(v / period_m * size) & (size - 1)
        return starts[geom] + level_starts[level] + row * size + column

    return texel


def _lighting(into_frame: Any, meet: Any) -> Any:
    """`share(lamp, solids, point, normal)`: see `Lamp.share`."""

    @_kernel(f"int64({_ROW}, {_ROW}, {_VECTOR})")
    def cell(lamp: Any, grid: Any, point: Vector) -> int:
        """Of the shadow map."""
        x, y, z = point
        cells = int(grid[CELLS])
        if z < lamp[LAMP_Z] - lamp[SLACK_M]:
            onward = lamp[LAMP_Z] / (lamp[LAMP_Z] - z)
            column = (lamp[LAMP_X] + (x - lamp[LAMP_X]) * onward - grid[GRID_X]) * grid[CELLS_A_METRE_X]
            row = (lamp[LAMP_Y] + (y - lamp[LAMP_Y]) * onward - grid[GRID_Y]) * grid[CELLS_A_METRE_Y]
            if 0 <= column < cells and 0 <= row < cells:
                return int(row) * cells + int(column)
        return cells * cells

    @_kernel(f"float64({_LAMP}, {_ROWS}, {_VECTOR}, {_VECTOR})")
    def share(lamp_and_shadows: Any, solids: Any, point: Vector, normal: Vector) -> float:
        lamp, in_frames, grid, start, members = lamp_and_shadows
        x, y, z = point[0] - lamp[LAMP_X], point[1] - lamp[LAMP_Y], point[2] - lamp[LAMP_Z]
        reach_m = math.sqrt(x * x + y * y + z * z)
        ray = x / reach_m, y / reach_m, z / reach_m
        facing = -(ray[0] * normal[0] + ray[1] * normal[1] + ray[2] * normal[2])
        if facing <= 0:
            return 0.0
        here = cell(lamp, grid, point)
        for entry in range(start[here], start[here + 1]):
            solid, at = solids[members[entry]], in_frames[members[entry]]
            first_m, _ = meet(solid, (at[0], at[1], at[2]), into_frame(solid, ray))
            if 0 <= first_m < reach_m - lamp[SLACK_M]:
                return 0.0
        return facing

    return share


def _picturing(see: Any, normal_at: Any, texel: Any, share: Any) -> Any:
    """`picture(eye, optics, solids, textures, lamp, pixels)`: fills the last; see `Camera`."""

    @_kernel(f"void({_EYE}, {_OPTICS}, {_ROWS}, {_TEXTURES}, {_LAMP}, uint8[:, ::1])")
    def picture(eye: Eye, optics: Any, solids: Any, textures: Any, lamp: Any, pixels: Any) -> None:
        lens, directions, _ = optics
        surfaces, _, texels, _, _ = textures
        eye_x, eye_y, eye_z, cos, sin = eye
        count = len(directions)
        distances_m, geoms, sides = np.empty(count), np.empty(count, np.int32), np.empty(count, np.int8)
        see(eye, optics, solids, distances_m, geoms, sides)
        for pixel in range(count):
            distance_m, geom = distances_m[pixel], geoms[pixel]
            if geom < 0:
                for channel in range(3):
                    pixels[pixel, channel] = np.uint8(lens[BEYOND + channel])
                continue
            ahead, left = directions[pixel, 0], directions[pixel, 1]
            ray = ahead * cos - left * sin, ahead * sin + left * cos, directions[pixel, 2]
            point = eye_x + ray[0] * distance_m, eye_y + ray[1] * distance_m, eye_z + ray[2] * distance_m
            normal = 0.0, 0.0, 1.0
            if geom > 0:
                normal = normal_at(eye, solids[geom - 1], sides[pixel], ray, point, distance_m)
            slant = -(ray[0] * normal[0] + ray[1] * normal[1] + ray[2] * normal[2])
            pixel_m = distance_m * lens[PIXEL_RAD] / math.sqrt(min(max(slant, lens[STEEPEST]), 1.0))
            colour = texel(textures, geom, point, normal, pixel_m)
            lit = share(lamp, solids, point, normal)
            for channel in range(3):
                brightness = lamp[0][AMBIENT] + lit * lamp[0][LAMP_RED + channel]
                value = texels[colour, channel] * surfaces[geom, TINT] * brightness
                pixels[pixel, channel] = np.uint8(min(max(value, 0.0), 255.0))

    return picture


def _feeling(into_frame: Any, meet: Any) -> Any:
    """`nearest(position, origins_m, rays, solids, cutoff_m, found_m)`: fills the last; see `Proximity`."""

    @_kernel(f"void(UniTuple(float64, 4), {_ROWS}, float64[:, :, ::1], {_ROWS}, float64, {_ROW})")
    def nearest(
        position: tuple[float, float, float, float],
        origins_m: Any,
        rays: Any,
        solids: Any,
        cutoff_m: float,
        found_m: Any,
    ) -> None:
        x_m, y_m, cos, sin = position
        for sensor in range(len(origins_m)):
            found_m[sensor] = math.inf
            x = x_m + (origins_m[sensor, 0] * cos - origins_m[sensor, 1] * sin)
            y = y_m + (origins_m[sensor, 0] * sin + origins_m[sensor, 1] * cos)
            for index in range(len(solids)):
                solid = solids[index]
                away = x - solid[X], y - solid[Y], origins_m[sensor, 2] - solid[Z]
                if max(abs(away[0]), abs(away[1])) > cutoff_m + solid[HALF_X] + solid[HALF_Y]:
                    continue
                point = into_frame(solid, away)
                for beam in range(rays.shape[1]):
                    ahead, left = rays[sensor, beam, 0], rays[sensor, beam, 1]
                    ray = ahead * cos - left * sin, ahead * sin + left * cos, rays[sensor, beam, 2]
                    met_m, _ = meet(solid, point, into_frame(solid, ray))
                    if 0 <= met_m < found_m[sensor] and met_m <= cutoff_m:
                        found_m[sensor] = met_m

    return nearest
