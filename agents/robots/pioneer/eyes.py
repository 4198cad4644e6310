"""What the cameras see: a plane alone, so each pixel looks at one point of the floor that moves with the robot."""

import math

import numpy as np
from numpy.typing import NDArray

from agents.robots.pioneer.floor import Floor
from agents.robots.pioneer.world import CameraTable, PioneerWorld

Floats = NDArray[np.float64]


class Pinhole:
    """One camera's geometry. The robot's frame: x forward, y left, z up; a picture's rows go down, columns right.

    Args:
        camera: where it is and looks.
        height: of the picture [px].
        width: of the picture [px].

    >>> down = Pinhole(CameraTable(height_m=1.0, pitch_deg=90.0, field_of_view_deg=90.0), height=64, width=80)
    >>> down.pixel_of(np.array([0.0, 0.0])).round(6).tolist()
    [32.0, 40.0]
    """

    def __init__(self, camera: CameraTable, height: int, width: int) -> None:
        yaw, pitch, roll = (math.radians(angle) for angle in (camera.yaw_deg, camera.pitch_deg, camera.roll_deg))
        forward = np.array([math.cos(pitch) * math.cos(yaw), math.cos(pitch) * math.sin(yaw), -math.sin(pitch)])
        right = np.array([math.sin(yaw), -math.cos(yaw), 0.0])
        down = np.cross(forward, right)
        # Rows: along the picture's columns, along its rows, out of the lens.
        self._axes = np.stack(
            [
                math.cos(roll) * right + math.sin(roll) * down,
                math.cos(roll) * down - math.sin(roll) * right,
                forward,
            ]
        )
        self._eye_m = np.array([camera.ahead_m, camera.left_m, camera.height_m])
        self._focal_px = width / 2 / math.tan(math.radians(camera.field_of_view_deg) / 2)
        self._shape = height, width

    def plane_points(self, height_m: float) -> tuple[Floats, Floats]:
        """Where each pixel's middle meets a level plane below the camera, and how large the pixel is there.

        Returns:
            (H, W, 2) [m] in the robot's frame, NaN at and above the horizon; (H, W) [m], side of a square of its area.
        """
        height, width = self._shape
        above_m = self._eye_m[2] - height_m
        row, column = np.mgrid[:height, :width] + 0.5
        offset = np.stack([column - width / 2, row - height / 2], -1) / self._focal_px
        ray = np.concatenate([offset, np.ones((height, width, 1))], -1) @ self._axes
        falling = np.where(ray[..., 2] < 0, -ray[..., 2], np.nan)
        points = self._eye_m[:2] + ray[..., :2] * (above_m / falling)[..., None]
        return points, above_m / self._focal_px * falling**-1.5

    def pixel_of(self, point_m: Floats) -> Floats:
        """(..., 2) points of the floor in the robot's frame -> (..., 2) row and column, NaN behind the lens."""
        flat = np.concatenate([point_m, np.zeros((*point_m.shape[:-1], 1))], -1)
        along, down, depth = np.moveaxis((flat - self._eye_m) @ self._axes.T, -1, 0)
        scale = self._focal_px / np.where(depth > 0, depth, np.nan)
        height, width = self._shape
        return np.stack([height / 2 + down * scale, width / 2 + along * scale], -1)


class Eyes:
    """All cameras over one floor, on the body that they see the edges of.

    Args:
        floor: is seen.
        world: its cameras, in order, and its body.
        height: of each picture [px].
        width: of each picture [px].
    """

    def __init__(self, floor: Floor, world: PioneerWorld, height: int, width: int) -> None:
        pinholes = [Pinhole(camera, height, width) for camera in world.camera]
        seen = [pinhole.plane_points(0.0) for pinhole in pinholes]
        points = np.stack([points for points, _ in seen], 2).reshape(-1, 2)
        pixel_m = np.stack([pixel_m for _, pixel_m in seen], 2).ravel()
        # What is not floor is as far away as anything can be: outside every map.
        self._x_m, self._y_m = np.nan_to_num(points, nan=1e6).astype(np.float32).T.copy()
        self._level = floor.levels_for(np.nan_to_num(pixel_m, nan=1.0))
        top = np.stack([pinhole.plane_points(world.body.height_m)[0] for pinhole in pinholes], 2)
        self._body = (np.abs(top) <= [world.body.length_m / 2, world.body.width_m / 2]).all(-1)
        self._body_grey = world.body.grey
        self._floor = floor

    def picture(self, pose: Floats) -> NDArray[np.uint8]:
        """(H, W, cameras) uint8, a grey picture each, from the pose [x_m, y_m, yaw_rad] on the map."""
        x_m, y_m, yaw_rad = pose.tolist()
        cos, sin = np.float32(math.cos(yaw_rad)), np.float32(math.sin(yaw_rad))
        at_x = np.float32(x_m) + cos * self._x_m - sin * self._y_m
        at_y = np.float32(y_m) + sin * self._x_m + cos * self._y_m
        picture = self._floor.greys(at_x, at_y, self._level).reshape(self._body.shape)
        picture[self._body] = self._body_grey
        return picture
