"""A layout: where everything stands in one arena, drawn from a scenario by a seed. Pure geometry, no MuJoCo.

The same list of shapes makes the scene that is seen and felt (`world.py`) and the footprints that block the body
(`body.py`), so that the three never disagree. What walks about is no part of it (`people.py`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from agents.robots.simulated.scenario import Obstacles, Scenario, Surface

Floats = NDArray[np.float64]

WALL_THICKNESS_M = 0.04
SEAT_THICKNESS_M = 0.02
TRIES = 2000  # dense arenas need hundreds for their last obstacle; each costs microseconds
STARTS = 200


@dataclass(frozen=True)
class Shape:
    """One solid.

    Attributes:
        kind: "box", "cylinder" (upright) or "ball".
        centre_m: x, y, z of its middle.
        half_m: half its extent along its own x, y, z; a round thing has x = y.
        yaw_rad: its turn about the vertical.
        surface: what it looks like.
        tint: brightness of this one piece, 1 being the surface's own.
        blocks: False for what the robot passes under.
    """

    kind: Literal["box", "cylinder", "ball"]
    centre_m: tuple[float, float, float]
    half_m: tuple[float, float, float]
    surface: Surface
    yaw_rad: float = 0.0
    tint: float = 1.0
    blocks: bool = True


class Footprints:
    """The outlines of shapes on the floor, as rounded rectangles: a box has no rounding, a round thing is nothing else.

    Args:
        shapes: what stands still.
        moving: what may be elsewhere after `move`.

    >>> from agents.robots.simulated.scenario import Surface
    >>> grey = Surface(name="grey", pattern="plain", colours=["#888888", "#888888"], period_m=1.0)
    >>> ball = Shape("ball", (1.0, 0.0, 0.05), (0.05, 0.05, 0.05), grey)
    >>> round(Footprints([ball]).clearance_m([0.0, 0.0]), 3)
    0.95
    """

    def __init__(self, shapes: Sequence[Shape], moving: Sequence[Shape] = ()) -> None:
        self.moving = len(moving)
        solid = [shape for shape in shapes if shape.blocks] + list(moving)
        self._centre = np.array([shape.centre_m[:2] for shape in solid], np.float64).reshape(-1, 2)
        half = np.array([shape.half_m[:2] for shape in solid], np.float64).reshape(-1, 2)
        is_box = np.array([shape.kind == "box" for shape in solid], bool)
        self._half = np.where(is_box[:, None], half, 0.0)
        self._rounding = np.where(is_box, 0.0, half[:, 0])
        yaw = np.array([shape.yaw_rad for shape in solid], np.float64)
        self._cos, self._sin = np.cos(yaw), np.sin(yaw)

    def move(self, centres_m: Floats) -> None:
        """Put what moves at (M, 2)."""
        self._centre[len(self._centre) - self.moving :] = centres_m

    def clearance_m(self, point_m: ArrayLike) -> float:
        """Distance from a point (2,) to the nearest outline; negative inside, inf where nothing stands."""
        if not len(self._centre):
            return np.inf
        x, y = (np.asarray(point_m, np.float64) - self._centre).T
        beyond_x = np.abs(self._cos * x + self._sin * y) - self._half[:, 0]
        beyond_y = np.abs(self._cos * y - self._sin * x) - self._half[:, 1]
        outside = np.hypot(np.maximum(beyond_x, 0), np.maximum(beyond_y, 0))
        inside = np.minimum(np.maximum(beyond_x, beyond_y), 0)
        return float((outside + inside - self._rounding).min())


@dataclass(frozen=True)
class Layout:
    """One arena.

    Attributes:
        scenario: what it was drawn from.
        shapes: walls and obstacles.
        start: where the robot begins, [x_m, y_m, yaw_rad].
    """

    scenario: Scenario
    shapes: list[Shape]
    start: tuple[float, float, float]

    @classmethod
    def draw(cls, scenario: Scenario, seed: int) -> "Layout":
        """The layout of this seed; ValueError if the scenario asks for more obstacles than fit."""
        rng = np.random.default_rng([seed, 1])
        shapes = _walls(scenario) + _obstacles(scenario, rng)
        return cls(scenario, shapes, _start(scenario, Footprints(shapes), rng))


def _walls(scenario: Scenario) -> list[Shape]:
    arena, surface = scenario.arena, scenario.surface_named(scenario.arena.wall)
    half_x, half_y, half_z = arena.length_m / 2, arena.width_m / 2, arena.wall_height_m / 2
    thin = WALL_THICKNESS_M / 2
    along_x = [Shape("box", (0, s * (half_y + thin), half_z), (half_x, thin, half_z), surface) for s in (-1, 1)]
    along_y = [Shape("box", (s * (half_x + thin), 0, half_z), (thin, half_y, half_z), surface) for s in (-1, 1)]
    return along_x + along_y


def _obstacles(scenario: Scenario, rng: np.random.Generator) -> list[Shape]:
    pieces = [_piece(scenario, group, rng) for group in scenario.obstacles for _ in range(group.count)]
    # The large ones first, or they find no room; Python's sort is stable, so the order is the seed's alone.
    pieces.sort(key=_reach_m, reverse=True)
    arena, placed, taken = scenario.arena, [], np.empty((0, 3))
    for piece in pieces:
        reach = _reach_m(piece)
        room = np.array([arena.length_m, arena.width_m]) / 2 - reach - arena.gap_m
        for _ in range(TRIES if (room > 0).all() else 0):
            spot = rng.uniform(-room, room)
            if (np.hypot(*(taken[:, :2] - spot).T) >= taken[:, 2] + reach + arena.gap_m).all():
                break
        else:
            raise ValueError(
                f"no room for obstacle {len(taken) + 1} of {len(pieces)} in {arena.length_m:g} x {arena.width_m:g} m "
                f"with gaps of {arena.gap_m:g} m: enlarge the arena, or give fewer or smaller obstacles"
            )
        taken = np.vstack([taken, [*spot, reach]])
        placed += _turned(piece, spot, rng.uniform(-np.pi, np.pi))
    return placed


def _piece(scenario: Scenario, group: Obstacles, rng: np.random.Generator) -> list[Shape]:
    """One obstacle about the origin, standing on the floor: a single shape, or the legs and the seat of a chair."""
    width, height = rng.uniform(*group.width_m) / 2, rng.uniform(*group.height_m) / 2
    surface = scenario.surface_named(group.surfaces[rng.integers(len(group.surfaces))])
    # Pieces of one stack differ a little, but what shares the floor's surface must stay hard to tell from it.
    tint = rng.uniform(0.95, 1.05) if surface.name == scenario.arena.floor else rng.uniform(0.75, 1.25)
    if group.kind == "box":
        depth = rng.uniform(*(group.depth_m or group.width_m)) / 2
        return [Shape("box", (0, 0, height), (width, depth, height), surface, tint=tint)]
    if group.kind == "ball":
        return [Shape("ball", (0, 0, width), (width, width, width), surface, tint=tint)]
    if group.kind in ("cylinder", "pole"):
        return [Shape("cylinder", (0, 0, height), (width, width, height), surface, tint=tint)]
    leg = rng.uniform(*group.leg_m) / 2
    kind: Literal["box", "cylinder"] = "box" if rng.random() < 0.5 else "cylinder"
    seat_z, side = 2 * height + SEAT_THICKNESS_M / 2, width + leg
    return [
        Shape(kind, (x * width, y * width, height), (leg, leg, height), surface, tint=tint)
        for x, y in ((-1, -1), (-1, 1), (1, 1), (1, -1))
    ] + [Shape("box", (0, 0, seat_z), (side, side, SEAT_THICKNESS_M / 2), surface, tint=tint, blocks=False)]


def _reach_m(piece: list[Shape]) -> float:
    """Radius of the circle about the origin that holds the piece."""
    return max(
        np.hypot(*shape.centre_m[:2]) + (np.hypot(*shape.half_m[:2]) if shape.kind == "box" else shape.half_m[0])
        for shape in piece
    )


def _turned(piece: list[Shape], spot: Floats, yaw_rad: float) -> list[Shape]:
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    return [
        Shape(
            shape.kind,
            (
                float(spot[0] + cos * shape.centre_m[0] - sin * shape.centre_m[1]),
                float(spot[1] + sin * shape.centre_m[0] + cos * shape.centre_m[1]),
                shape.centre_m[2],
            ),
            shape.half_m,
            shape.surface,
            float(yaw_rad),
            shape.tint,
            shape.blocks,
        )
        for shape in piece
    ]


def _start(scenario: Scenario, footprints: Footprints, rng: np.random.Generator) -> tuple[float, float, float]:
    """The roomiest of some random spots, so that there always is one."""
    half = np.array([scenario.arena.length_m, scenario.arena.width_m]) / 2
    spots = rng.uniform(-half, half, (STARTS, 2))
    best = max(spots, key=footprints.clearance_m)
    return float(best[0]), float(best[1]), float(rng.uniform(-np.pi, np.pi))
