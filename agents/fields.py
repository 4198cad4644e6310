"""Reading a field of a message, as `llrp_online.configuration.field` says it."""

import math
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.messages import MessageError
from llrp_online.configuration.field import Field, Having, Sector

_HAIR_RAD = 1e-4  # of a beam that stands on a sector's edge


def read_field(message: object, field: Field) -> float | None:
    """The number there; None if the message says nothing of it; MessageError says what there is instead.

    >>> from agents import messages
    >>> read_field(messages.laser_scan(0, [1.0, 2.0], (0.0, 0.1), (0.0, 4.0)), Field.parse("ranges[1]"))
    2.0
    """
    value: Any = message
    for number, part in enumerate(field.parts):
        if isinstance(part, Having):
            last = number == len(field.parts) - 1
            value = _having(value, part, count=last)
            if value is None:
                return None
        elif isinstance(part, Sector):
            value = _nearest(message, value, part)
        else:
            value = _step(value, part)
    if not isinstance(value, (float, int, np.number)):
        raise MessageError(f"expected a number, got {type(value).__name__}")
    return float(value)


def _step(value: Any, part: str | int) -> Any:
    try:
        return value[part] if isinstance(part, int) else getattr(value, part)
    except AttributeError:
        names = [name for name in vars(value) if not name.startswith("_")] if hasattr(value, "__dict__") else []
        raise MessageError(f"no '{part}'; there is {', '.join(names) or type(value).__name__}") from None
    except IndexError:
        raise MessageError(f"no element {part}; there are {len(value)}") from None
    except TypeError:
        raise MessageError(f"'{part}' of a {type(value).__name__}, which is no list") from None


def _having(value: Any, condition: Having, *, count: bool) -> Any:
    """The first element that meets the condition, or how many do; of a message, itself or None."""
    if not isinstance(value, list):
        return value if _read(value, condition) == condition.value else None
    elements: list[Any] = value
    said = [_read(element, condition) for element in elements]
    if count:
        return said.count(condition.value)
    if condition.value not in said:
        way = ".".join(condition.path)
        raise MessageError(f"no element with {way} = {condition.value}; there are {', '.join(said) or 'none at all'}")
    return elements[said.index(condition.value)]


def _read(value: Any, condition: Having) -> str:
    for name in condition.path:
        value = _step(value, name)
    return str(value)


def _nearest(message: Any, ranges: Any, sector: Sector) -> float:
    """The least of a scan's ranges within a sector: inf where nothing is in reach, NaN where nothing is known.

    What lies outside the limits that the scan itself gives is no measurement (REP 117), except for the infinities.
    """
    try:
        first_rad, step_rad = float(message.angle_min), float(message.angle_increment)
        limits_m = float(message.range_min), float(message.range_max)
    except AttributeError:
        raise MessageError(f"a sector of a {type(message).__name__}, which is no scan with angles") from None
    beams = _beams(len(ranges), first_rad, step_rad, sector)
    if not beams.any():
        span = math.degrees(first_rad), math.degrees(first_rad + step_rad * (len(ranges) - 1))
        raise MessageError(f"no beam in that sector; the scan goes from {span[0]:.1f} to {span[1]:.1f} deg")
    found = np.asarray(ranges, np.float64)[beams]
    known = ((found >= limits_m[0]) & (found <= limits_m[1])) | np.isinf(found)
    return float(found[known].min()) if known.any() else math.nan


@cache
def _beams(count: int, first_rad: float, step_rad: float, sector: Sector) -> NDArray[np.bool_]:
    """Which beams lie in the sector, whichever turn their angles are counted in."""
    behind = first_rad + step_rad * np.arange(count) - sector.first_rad + _HAIR_RAD
    return behind % math.tau <= sector.last_rad - sector.first_rad + 2 * _HAIR_RAD
