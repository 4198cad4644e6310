"""What one unit of a wheel is in metres, how alike the wheels are, and how far apart: from two drives and a tape.

Straight on, both wheels at one target: the tape says how far it got and how far aside, and so how far each wheel rolled
but for the track. Then turns on the spot: how far the wheels rolled against each other is the track times the angle.
That is three linear equations for the left wheel's unit, the right one's, and the track.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from agents.robots.thymio.firmware import BEAT_S, Firmware, Report
from agents.robots.thymio.link import Link
from agents.robots.thymio.wheels import difference

_LIFE_S = 0.3
_REST_REPORTS = 6  # without a beat of the wheels: it stands
_LEAST_TURN_RAD = math.pi  # less says nothing about the track


@dataclass(frozen=True)
class Leg:
    """How far the wheels rolled, in the firmware's own units of speed times seconds.

    >>> Leg(0.0, 0.0).plus(Report(5, 100, 65436, 0, ()), Report(10, 600, 64936, 0, ()))
    Leg(left=5.0, right=-5.0)
    """

    left: float
    right: float

    def plus(self, before: Report, after: Report) -> "Leg":
        """With what came between two reports."""
        return Leg(
            self.left + difference(after.left, before.left) * BEAT_S,
            self.right + difference(after.right, before.right) * BEAT_S,
        )


@dataclass(frozen=True)
class Calibrated:
    """What was found; the keys of [thymio].

    >>> straight, spin = Leg(2900.0, 2910.0), Leg(-8000.0, 8000.0)
    >>> found = solve(straight, 1.0, 0.0, spin, 10 * 2 * math.pi)
    >>> round(found.speed_unit_m_s, 6), round(found.left_scale, 3), round(found.track_m, 4)
    (0.000344, 1.002, 0.0877)
    """

    speed_unit_m_s: float
    left_scale: float
    right_scale: float
    track_m: float


def solve(straight: Leg, ahead_m: float, aside_m: float, spin: Leg, turned_rad: float) -> Calibrated:
    """The calibration that explains both drives; ValueError where none does.

    Args:
        straight: what the wheels said of the drive straight on.
        ahead_m: how far it got along its first heading.
        aside_m: how far it came off that line, left positive.
        spin: what the wheels said of the turns on the spot, to the left.
        turned_rad: how far it turned in truth.
    """
    if not ahead_m > 0 or not turned_rad > _LEAST_TURN_RAD:
        raise ValueError(
            f"got {ahead_m:g} m ahead and {math.degrees(turned_rad):g} degrees turned; "
            "expected more than 0 m and more than half a turn to the left"
        )
    # An arc that begins along the line and ends at (ahead, aside): its turn and its length.
    bent_rad = 2 * math.atan2(aside_m, ahead_m)
    arc_m = math.hypot(ahead_m, aside_m) / np.sinc(bent_rad / (2 * math.pi))
    equations = np.array(
        [
            [straight.left, 0.0, bent_rad / 2],
            [0.0, straight.right, -bent_rad / 2],
            [-spin.left, spin.right, -turned_rad],
        ]
    )
    try:
        left_m, right_m, track_m = np.linalg.solve(equations, [arc_m, arc_m, 0.0]).tolist()
    except np.linalg.LinAlgError:
        left_m = right_m = track_m = math.nan
    unit_m = (left_m + right_m) / 2
    if not (left_m > 0 and right_m > 0 and track_m > 0):
        raise ValueError(
            f"the wheels said {straight} and {spin}, the tape {ahead_m:g} m, {aside_m:g} m aside and "
            f"{math.degrees(turned_rad):g} degrees: no robot is like that; drive and measure again"
        )
    return Calibrated(unit_m, left_m / unit_m, right_m / unit_m, track_m)


def roll(port: str, left: int, right: int, enough: Callable[[Leg], bool]) -> Leg:
    """Turn the wheels at these targets until what they said is enough, then let them come to rest; all they said."""
    with Link(port) as link:
        firmware = Firmware(link)
        try:
            before, leg, resting = firmware.report(), Leg(0.0, 0.0), 0
            driving = True
            while resting < _REST_REPORTS:
                driving = driving and not enough(leg)
                firmware.drive(*((left, right) if driving else (0, 0)), life_s=_LIFE_S)
                after = firmware.report()
                still = (after.left, after.right) == (before.left, before.right)
                resting = resting + 1 if still and not driving else 0
                leg, before = leg.plus(before, after), after
        finally:
            firmware.halt()
    return leg


def feel(port: str, sensor: int, reports: int = 40) -> float:
    """What a proximity sensor says, left to right from 0: the median over two seconds."""
    with Link(port) as link:
        firmware = Firmware(link)
        return float(np.median([firmware.report().proximity[sensor] for _ in range(reports)]))
