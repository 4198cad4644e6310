"""A scenario: what a simulated arena is made of, as `configs/scenarios/*.toml` says it.

The paper recorded ten, "each featuring a different floor type and a different set of obstacles" (Nava et al. 2019,
section IV-B). A scenario names kinds and ranges of sizes; a seed then draws one layout from it (`layout.py`).
"""

import re
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from llrp_online.configuration import Table, load_toml

LOWEST_SEAT_M = 0.15

Pattern = Literal[
    "plain",
    "tiles",
    "checker",
    "planks",
    "cardboard",
    "linoleum",
    "flagstones",
    "carpet",
    "grass",
    "concrete",
    "terrazzo",
    "bricks",
    "stripes",
    "speckle",
]


def _colour(text: str) -> str:
    if not re.fullmatch(r"#[0-9a-fA-F]{6}", text):
        raise ValueError("expected a colour such as `#c8b090`")
    return text


def _ascending(span: tuple[float, float]) -> tuple[float, float]:
    if not 0 < span[0] <= span[1]:
        raise ValueError(f"expected [smallest, largest] with 0 < smallest <= largest, got {list(span)}")
    return span


# TOML knows lists alone: where a tuple is wanted, a list of its length will do.
Colour = Annotated[str, AfterValidator(_colour)]
Colours = Annotated[tuple[Colour, ...], Field(strict=False)]
Span = Annotated[tuple[float, float], Field(strict=False), AfterValidator(_ascending)]


class Surface(Table):
    """[[surface]]: what something looks like.

    >>> Surface(name="lawn", pattern="grass", colours=["#16300e", "#70903c"], period_m=0.5).pattern
    'grass'
    """

    name: str
    pattern: Pattern = Field(description="how it is drawn")
    colours: Colours = Field(min_length=2, description="dark to light, or base first and then its details")
    period_m: float = Field(gt=0, description="the picture repeats after this far [m]")


class Arena(Table):
    """[arena]: the walled floor."""

    length_m: float = Field(gt=0.5, description="inside the walls, along x [m]")
    width_m: float = Field(gt=0.5, description="inside the walls, along y [m]")
    wall_height_m: float = Field(default=0.3, gt=0.05, description="above the floor [m]")
    gap_m: float = Field(default=0.14, ge=0, description="free passage around every obstacle; the robot is 0.11 [m]")
    floor: str = Field(description="name of its surface")
    wall: str = Field(description="name of its surface")


class Light(Table):
    """[light]: one lamp, or a far-away sun, that throws hard shadows."""

    azimuth_deg: float = Field(description="where it stands, seen from the arena's middle, counter-clockwise from x")
    elevation_deg: float = Field(gt=5, le=90, description="and how high")
    distance_m: float = Field(gt=0.5, description="from the arena's middle; 100 is as good as the sun [m]")
    strength: float = Field(
        gt=0, description="brightness it adds to a surface that faces it, 1 being the surface's own"
    )
    ambient: float = Field(gt=0, description="brightness in the shadow")
    colour: Colour = Field(default="#ffffff", description="of the lamp; shadows stay neutral")


class Obstacles(Table):
    """[[obstacles]]: some obstacles of one kind, each with its own size within the given spans."""

    kind: Literal["box", "cylinder", "ball", "chair", "pole"]
    count: int = Field(ge=1)
    width_m: Span = Field(description="side of a box, diameter of a round thing, distance between chair legs [m]")
    depth_m: Span | None = Field(default=None, description="a box's other side; left out: drawn like `width_m` [m]")
    height_m: Span = Field(default=(0.1, 0.25), description="of a box, cylinder or pole; of a chair's seat [m]")
    leg_m: Span = Field(default=(0.015, 0.03), description="thickness of a chair's legs [m]")
    surfaces: list[str] = Field(min_length=1, description="names of the surfaces they are drawn from")

    @model_validator(mode="after")
    def _passes_under_chairs(self) -> Self:
        if self.kind == "chair" and self.height_m[0] < LOWEST_SEAT_M:
            raise ValueError(
                f"height_m: a chair's seat must be at least {LOWEST_SEAT_M} m high for the camera to pass under it, "
                f"got {self.height_m[0]:g}"
            )
        return self


class Person(Table):
    """[[people]]: someone who walks about: two legs, straight on until something stands in the way.

    >>> Person(surface="denim").speed_m_s
    0.3
    """

    surface: str = Field(description="name of the trousers' surface")
    leg_m: float = Field(default=0.08, ge=0.04, le=0.3, description="thickness of a leg [m]")
    apart_m: float = Field(default=0.14, gt=0, le=0.5, description="from the middle of one leg to the other's [m]")
    height_m: float = Field(default=0.8, gt=0.05, description="of the legs; nothing is above them [m]")
    speed_m_s: float = Field(default=0.3, gt=0, le=1.0, description="of walking")
    stop_m: float = Field(default=0.06, ge=0, description="goes no nearer to the robot than this [m]")
    patience_s: float = Field(default=2.0, ge=0, description="waits so long for the robot, then goes elsewhere [s]")

    @model_validator(mode="after")
    def _has_two_legs(self) -> Self:
        if self.apart_m < self.leg_m:
            raise ValueError(f"apart_m: the legs would overlap; expected at least leg_m = {self.leg_m:g}")
        return self


class Scenario(Table):
    """The whole of a scenario's TOML."""

    arena: Arena
    light: Light
    surface: list[Surface] = Field(min_length=1)
    obstacles: list[Obstacles] = Field(min_length=1)
    people: list[Person] = Field(default_factory=list[Person])

    def surface_named(self, name: str) -> Surface:
        """The surface of that name; the scenario was checked to have it."""
        return next(surface for surface in self.surface if surface.name == name)

    @model_validator(mode="after")
    def _names_exist(self) -> Self:
        names = [surface.name for surface in self.surface]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"surface: each name must be given once, got {twice} more than once")
        used = {"arena.floor": [self.arena.floor], "arena.wall": [self.arena.wall]}
        used |= {f"obstacles[{i}].surfaces": group.surfaces for i, group in enumerate(self.obstacles)}
        used |= {f"people[{i}].surface": [person.surface] for i, person in enumerate(self.people)}
        for key, wanted in used.items():
            if missing := [name for name in wanted if name not in names]:
                raise ValueError(f"{key}: no surface is named {missing[0]!r}; allowed: {', '.join(sorted(names))}")
        return self


def load_scenario(path: str | Path) -> Scenario:
    """Read a scenario's TOML; ConfigurationError names file, key, what was got and what is allowed."""
    return load_toml(path, Scenario)
