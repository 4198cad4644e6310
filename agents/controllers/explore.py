"""The paper's data acquisition behaviour (Nava et al. 2019, section IV-C), as a state machine on odometry.

Forward until any sensor feels an obstacle (FORWARD); then for each of five directions about the heading it came with:
turn there (ALIGN), 30 cm back (BACK) and as far forward again (FORTH); then turn away at random (AWAY) and go on. Every
stroke sees the obstacle from all the distances the labels ask about, from five sides.
"""

from enum import Enum

import numpy as np
from numpy.typing import NDArray

from agents.controllers.motion import (
    HEADING_TOLERANCE_RAD,
    WAY_TOLERANCE_M,
    advancing,
    heading_error,
    turning,
)
from agents.controllers.touch import ByTouch
from llrp_online.configuration.running import Control

Floats = NDArray[np.float64]

AWAY_RAD = (np.pi / 2, 3 * np.pi / 2)  # the half-plane behind, as seen from the obstacle's direction
AWAY_TRIES = 6  # further random directions when something stands there too


class Phase(Enum):
    """What the robot is doing."""

    FORWARD = "forward"
    ALIGN = "align"
    BACK = "back"
    FORTH = "forth"
    AWAY = "away"


class Explore(ByTouch):
    """The acquisition behaviour. Needs the short-range bits, no predictions; without recent bits it stands still.

    What ends a move early: in FORWARD, being stuck counts as an obstacle (something too thin or too low to be felt); in
    BACK, being stuck or slow ends the stroke there, and FORTH is then as short: it always returns to its post.

    >>> explore = Explore(Control(), seed=0)
    >>> explore.command(0, np.zeros(3), np.zeros(5, np.int8), None)
    (0.12, 0.0)
    >>> explore.command(1, np.zeros(3), np.array([0, 0, 1, 0, 0], np.int8), None), explore.phase
    ((0.0, -1.5), <Phase.ALIGN: 'align'>)
    """

    def __init__(self, control: Control, seed: int) -> None:
        super().__init__(control, seed)
        self._offsets_rad = np.deg2rad(control.directions_deg)
        self._directions: list[float] = []  # headings still to look along at this obstacle
        self._obstacle_rad = 0.0  # the heading in which it was met
        self._target_rad = 0.0  # the heading to turn to, or to keep
        self._post: Floats = np.zeros(3)  # where all strokes at this obstacle begin and end
        self._way_m = 0.0  # how far this stroke goes, negative backwards
        self._away_tries = 0
        self.phase = Phase.FORWARD

    def _decide(self, t_ns: int, pose: Floats, felt: NDArray[np.bool_], *, stuck: bool) -> None:
        something = bool(felt.any())
        if self._is_over(t_ns, pose, something, stuck):
            self._enter_next(pose, something)
            self._begin(t_ns, pose)

    def _is_over(self, t_ns: int, pose: Floats, felt: bool, stuck: bool) -> bool:
        if self.phase is Phase.FORWARD:
            return felt or stuck
        late = self._began_ns is not None and t_ns - self._began_ns > self._control.give_up_s * 1e9
        return stuck or late or self._has_arrived(pose)

    def _has_arrived(self, pose: Floats) -> bool:
        if self.phase in (Phase.ALIGN, Phase.AWAY):
            return abs(heading_error(self._target_rad, pose)) < HEADING_TOLERANCE_RAD
        return abs(self._remaining_m(pose)) < WAY_TOLERANCE_M

    def _enter_next(self, pose: Floats, felt: bool) -> None:
        if self.phase is Phase.FORWARD:
            self._obstacle_rad = float(pose[2])
            self._directions = [self._obstacle_rad + offset for offset in self._offsets_rad]
            self._look_along_next()
        elif self.phase is Phase.ALIGN:
            # Wheels need a moment to stop: the post is where the robot has come to rest, not where it felt something.
            if len(self._directions) == len(self._offsets_rad) - 1:
                self._post = pose
            self.phase, self._way_m = Phase.BACK, -self._control.stroke_m
        elif self.phase is Phase.BACK:
            self.phase, self._way_m = Phase.FORTH, self._along_m(pose, self._post)
        elif self.phase is Phase.FORTH and self._directions:
            self._look_along_next()
        elif self.phase is Phase.FORTH:
            self._away_tries = AWAY_TRIES
            self._turn_away()
        elif felt and self._away_tries:
            self._away_tries -= 1
            self._turn_away()
        else:
            self.phase = Phase.FORWARD

    def _look_along_next(self) -> None:
        self.phase, self._target_rad = Phase.ALIGN, self._directions.pop(0)

    def _turn_away(self) -> None:
        self.phase, self._target_rad = Phase.AWAY, self._obstacle_rad + float(self._rng.uniform(*AWAY_RAD))

    def _drive(self, pose: Floats) -> tuple[float, float]:
        if self.phase is Phase.FORWARD:
            return self._control.speed_m_s, 0.0
        turn = turning(heading_error(self._target_rad, pose), self._control)
        if self.phase in (Phase.ALIGN, Phase.AWAY):
            return 0.0, turn
        return advancing(self._remaining_m(pose), self._control), turn

    def _along_m(self, start: Floats, stop: Floats) -> float:
        """The way between two poses along the heading of this stroke."""
        dx, dy = stop[:2] - start[:2]
        return float(dx * np.cos(self._target_rad) + dy * np.sin(self._target_rad))

    def _remaining_m(self, pose: Floats) -> float:
        return self._way_m - self._along_m(self._began, pose)
