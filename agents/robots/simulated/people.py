"""People who walk about in an arena: each two legs, seen, felt and run into as anything else.

A person walks straight on. Before a wall or an obstacle they turn to where there is room; before the robot, or someone
else, they stop, and after a while go elsewhere. Nobody ever walks into the robot; the robot may well drive into them.
One leg is before the other, as in the middle of a stride, so that they get through wherever a robot would. Legs glide:
they do not swing, step over nothing, and turn on the spot.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from agents.robots.simulated.layout import Footprints, Layout, Shape
from agents.robots.simulated.scenario import Person, Scenario

Floats = NDArray[np.float64]
Disc = tuple[float, float, float]  # x, y and radius [m]

MARGIN_M = 0.01  # a leg keeps so far from walls and obstacles
HEADINGS = 8  # looked along before one is chosen
LOOK_M, LOOK_STEP_M = 1.0, 0.1  # so far, and at each of these steps
START_M = 0.4  # nobody begins nearer to the robot's middle
TRIES = 2000


class Walker:
    """One person.

    Args:
        person: what they are like.
        still: what stands still.
        spot_m: [x, y] between the legs, at first.
        heading_rad: they walk along, at first.
        rng: draws where to turn.

    Attributes:
        legs_m: (2, 2) float64 [x, y] of the leg in front and the one behind.

    >>> walker = Walker(Person(surface="denim"), Footprints([]), [0.0, 0.0], 0.0, np.random.default_rng(0))
    >>> walker.step([], 0.5)
    >>> walker.legs_m.round(2).tolist()
    [[0.22, 0.0], [0.08, 0.0]]
    """

    def __init__(
        self, person: Person, still: Footprints, spot_m: Sequence[float], heading_rad: float, rng: np.random.Generator
    ) -> None:
        self._person, self._still, self._rng = person, still, rng
        self._spot_m: Floats = np.array(spot_m, np.float64)
        self._heading_rad, self._waited_s = heading_rad, 0.0
        self.legs_m = self._legs_m(0.0, heading_rad)

    @property
    def discs(self) -> list[Disc]:
        """Both legs."""
        return [(x, y, self._person.leg_m / 2) for x, y in self.legs_m.tolist()]

    def fits(self, discs: Sequence[Disc]) -> bool:
        """Is there room where they stand, beside what stands still and `discs`?"""
        return self._is_clear(self.legs_m) and self._gap_m(self.legs_m, discs) >= self._person.stop_m

    def step(self, discs: Sequence[Disc], duration_s: float) -> None:
        """Walk on for one tick, if nothing stands there; `discs` are the robot and other people's legs."""
        way_m = self._person.speed_m_s * duration_s
        onward_m = self._legs_m(way_m, self._heading_rad)
        if not self._is_clear(onward_m):
            self._turn(discs)
        elif self._keeps_away(onward_m, discs):
            self._stand(way_m, self._heading_rad)
        else:
            self._waited_s += duration_s
            if self._waited_s > self._person.patience_s:
                self._turn(discs)

    def _turn(self, discs: Sequence[Disc]) -> None:
        """Turn to one of a few headings, the roomier the likelier; stay if there is room for none."""
        headings = self._rng.uniform(-np.pi, np.pi, HEADINGS)
        ways_m = np.array([self._free_m(heading, discs) for heading in headings])
        if ways_m.any():  # always the roomiest: they would go back and forth between two ends
            self._stand(0.0, float(self._rng.choice(headings, p=ways_m / ways_m.sum())))

    def _free_m(self, heading_rad: float, discs: Sequence[Disc]) -> float:
        """How far they could walk along a heading, up to `LOOK_M`; 0 if not even turn."""
        for step in range(round(LOOK_M / LOOK_STEP_M) + 1):
            legs_m = self._legs_m(step * LOOK_STEP_M, heading_rad)
            if not (self._is_clear(legs_m) and self._keeps_away(legs_m, discs)):
                return step * LOOK_STEP_M
        return LOOK_M

    def _stand(self, way_m: float, heading_rad: float) -> None:
        self.legs_m = self._legs_m(way_m, heading_rad)
        self._spot_m, self._heading_rad, self._waited_s = self.legs_m.mean(0), heading_rad, 0.0

    def _legs_m(self, way_m: float, heading_rad: float) -> Floats:
        """Where the legs are after walking so far from here along a heading."""
        ahead = np.array([np.cos(heading_rad), np.sin(heading_rad)])
        middle, half = self._spot_m + way_m * ahead, self._person.apart_m / 2
        return np.stack([middle + half * ahead, middle - half * ahead])

    def _is_clear(self, legs_m: Floats) -> bool:
        need_m = self._person.leg_m / 2 + MARGIN_M
        return all(self._still.clearance_m(leg_m) >= need_m for leg_m in legs_m)

    def _keeps_away(self, legs_m: Floats, discs: Sequence[Disc]) -> bool:
        """Far enough from all that moves; or, where that came too near by itself, farther away than now."""
        gap_m = self._gap_m(legs_m, discs)
        return gap_m >= self._person.stop_m or gap_m > self._gap_m(self.legs_m, discs)

    def _gap_m(self, legs_m: Floats, discs: Sequence[Disc]) -> float:
        """From the legs to the nearest disc; inf without any."""
        if not discs:
            return np.inf
        x, y, radius = np.array(discs).T
        gaps = np.hypot(legs_m[:, :1] - x, legs_m[:, 1:] - y) - radius - self._person.leg_m / 2
        return float(gaps.min())


class People:
    """All people of an arena.

    Attributes:
        shapes: their legs, as they stand at first, two a person.
    """

    def __init__(self, scenario: Scenario, layout: Layout, seed: int) -> None:
        self._walkers: list[Walker] = []
        self.shapes: list[Shape] = []
        rng, still = np.random.default_rng([seed, 4]), Footprints(layout.shapes)
        half = np.array([scenario.arena.length_m, scenario.arena.width_m]) / 2
        taken: list[Disc] = [(*layout.start[:2], START_M)]
        for person in scenario.people:
            walker = _placed(person, still, half, taken, rng)
            self._walkers.append(walker)
            taken += walker.discs
            surface, half_m = scenario.surface_named(person.surface), (person.leg_m / 2, person.height_m / 2)
            self.shapes += [
                Shape("cylinder", (x, y, half_m[1]), (half_m[0], half_m[0], half_m[1]), surface)
                for x, y in walker.legs_m.tolist()
            ]

    @property
    def legs_m(self) -> Floats:
        """(M, 2) float64 [x, y] of all legs, in the order of `shapes`."""
        return np.concatenate([walker.legs_m for walker in self._walkers]) if self._walkers else np.empty((0, 2))

    def step(self, robot: Disc, duration_s: float) -> None:
        """Everyone walks for one tick, in turn."""
        for walker in self._walkers:
            others = [disc for other in self._walkers if other is not walker for disc in other.discs]
            walker.step([robot, *others], duration_s)


def _placed(
    person: Person, still: Footprints, half_m: Floats, taken: Sequence[Disc], rng: np.random.Generator
) -> Walker:
    for _ in range(TRIES):
        spot_m, heading_rad = rng.uniform(-half_m, half_m), rng.uniform(-np.pi, np.pi)
        walker = Walker(person, still, spot_m.tolist(), heading_rad, rng)
        if walker.fits(taken):
            return walker
    raise ValueError(
        f"no room for a person with legs of {person.leg_m:g} m, {person.apart_m:g} m apart, in an arena of "
        f"{2 * half_m[0]:g} x {2 * half_m[1]:g} m: enlarge it, or give thinner legs, fewer obstacles or fewer people"
    )
