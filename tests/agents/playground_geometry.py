"""What a proximity sensor of the simulated Thymio would truly feel: rays cast into a scene, by plain geometry."""

import xml.etree.ElementTree
from pathlib import Path

import numpy as np

#: Where the five sensors are on the robot and where they look, left to right [m, m, rad], from the simulator's source.
SENSORS = np.array(
    [
        [0.062, 0.0485, np.deg2rad(40)],
        [0.075, 0.0255, np.deg2rad(20)],
        [0.0795, 0.0, 0.0],
        [0.075, -0.0255, np.deg2rad(-20)],
        [0.062, -0.0485, np.deg2rad(-40)],
    ]
)
_HALF_CONE_RAD = np.deg2rad(15)
BODY_M = 0.085  # no part of the robot is farther from its axle's middle


class Scene:
    """The walls and posts of a playground file, in metres."""

    def __init__(self, path: Path) -> None:
        root = xml.etree.ElementTree.parse(path).getroot()
        world = root.find("world")
        self.size = np.array([float(world.get("w")), float(world.get("h"))]) / 100
        self._boxes = [
            [float(wall.get(name)) / 100 * share for name, share in (("x", 1), ("y", 1), ("l1", 0.5), ("l2", 0.5))]
            for wall in root.iter("wall")
        ]
        self._posts = [[float(post.get(name)) / 100 for name in ("x", "y", "r")] for post in root.iter("cylinder")]

    def is_free(self, x: float, y: float) -> bool:
        """A robot fits there, however it looks."""
        gaps = [x, y, self.size[0] - x, self.size[1] - y]
        gaps += [np.hypot(x - px, y - py) - r for px, py, r in self._posts]
        gaps += [np.hypot(max(abs(x - bx) - hx, 0), max(abs(y - by) - hy, 0)) for bx, by, hx, hy in self._boxes]
        return min(gaps) > BODY_M

    def rays_m(self, pose: np.ndarray) -> np.ndarray:
        """(5, 3) [m] from the sensors, left to right, along the middle and the edges of what each sees."""
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        found = np.empty((len(SENSORS), 3))
        for row, (ahead, left, angle) in enumerate(SENSORS):
            x, y = pose[0] + cos * ahead - sin * left, pose[1] + sin * ahead + cos * left
            for column, offset in enumerate((-_HALF_CONE_RAD, 0.0, _HALF_CONE_RAD)):
                found[row, column] = self._cast(x, y, pose[2] + angle + offset)
        return found

    def _cast(self, x: float, y: float, angle: float) -> float:
        way = np.array([np.cos(angle), np.sin(angle)])
        at = np.array([x, y])
        hits = [np.inf]
        for axis in (0, 1):
            hits += [(edge - at[axis]) / way[axis] for edge in (0.0, self.size[axis]) if way[axis]]
        for px, py, r in self._posts:
            along = way @ (np.array([px, py]) - at)
            aside = np.hypot(px - x, py - y) ** 2 - along**2
            hits.append(along - np.sqrt(r**2 - aside) if aside < r**2 else np.inf)
        for bx, by, hx, hy in self._boxes:
            middle, half = np.array([bx, by]), np.array([hx, hy])
            with np.errstate(divide="ignore"):
                one, other = (middle - half - at) / way, (middle + half - at) / way
            enters, leaves = np.minimum(one, other).max(), np.maximum(one, other).min()
            hits.append(enters if enters <= leaves else np.inf)
        return min((hit for hit in hits if hit >= 0), default=np.inf)
