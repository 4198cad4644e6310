"""Where in a message a short-range reading stands: a small language, so that no robot needs an adapter.

| written | read |
|---|---|
| `range`, `pose.position.z` | a number |
| `ranges[3]` | an element |
| `ranges[-30deg:-10deg]` | the least range of a scan within these angles, counter-clockwise from the first |
| `readings[header.frame_id=ir_left].value` | of the first element that has this |
| `detections[header.frame_id=bump_left]` | how many elements have this |
| `[bumper=0].state` | of the message, if it has this; else it says nothing of this sensor |
| `latest ...` | what was said last holds until something else is said |
"""

import re
from dataclasses import dataclass
from math import radians

_NAME = r"[A-Za-z_]\w*"
_NUMBER = r"-?\d+(?:\.\d+)?"
_LATEST = "latest "
_PART = re.compile(
    rf"(?P<dot>\.?)(?P<name>{_NAME})"
    rf"|\[(?P<index>\d+)\]"
    rf"|\[(?P<first>{_NUMBER})deg:(?P<last>{_NUMBER})deg\]"
    rf"|\[(?P<path>{_NAME}(?:\.{_NAME})*)=(?P<value>[\w./+-]+)\]"
)


@dataclass(frozen=True)
class Sector:
    """Angles [rad], counter-clockwise from the first to the last."""

    first_rad: float
    last_rad: float


@dataclass(frozen=True)
class Having:
    """Elements whose value at `path` reads as `value`."""

    path: tuple[str, ...]
    value: str


Part = str | int | Sector | Having


@dataclass(frozen=True)
class Field:
    """A way through a message, parsed.

    Attributes:
        parts: names, indices, sectors and conditions, in order.
        latest: what was said last holds.

    >>> Field.parse("latest [bumper=0].state")
    Field(parts=(Having(path=('bumper',), value='0'), 'state'), latest=True)
    """

    parts: tuple[Part, ...]
    latest: bool = False

    @classmethod
    def parse(cls, text: str) -> "Field":
        """ValueError says what was expected."""
        way = text.removeprefix(_LATEST)
        parts: list[Part] = []
        end = 0
        while end < len(way):
            found = _PART.match(way, end)
            if found is None or bool(found["dot"]) != bool(found["name"] and parts):
                raise _fault(text)
            parts.append(_part(found))
            end = found.end()
        inner, names = parts[:-1], [part for part in parts if isinstance(part, str)]
        if not names or any(isinstance(part, Sector) for part in inner):
            raise _fault(text)
        return cls(tuple(parts), latest=way != text)

    @property
    def beam(self) -> int:
        """The number of the beam that a field such as `ranges[3]` names; -1 if it says something else."""
        if len(self.parts) == 2 and self.parts[0] == "ranges" and isinstance(self.parts[1], int):
            return self.parts[1]
        return -1


def _part(found: re.Match[str]) -> Part:
    if found["name"]:
        return found["name"]
    if found["index"]:
        return int(found["index"])
    if found["path"]:
        return Having(tuple(found["path"].split(".")), found["value"])
    return Sector(radians(float(found["first"])), radians(float(found["last"])))


def _fault(text: str) -> ValueError:
    return ValueError(
        f"field {text!r}: expected names and indices such as `ranges[3]` or `pose.position.z`, a sector such as "
        "`ranges[-15deg:15deg]`, or a condition such as `readings[header.frame_id=left].value`"
    )
