"""What may differ from what a robot learned from: its camera's pose, its pictures, the world. One thing at a time."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

Arena = dict[str, Any]
Kind = Literal["camera pose", "picture", "world"]


def _as_it_is(arena: Arena) -> Arena:
    return arena


@dataclass(frozen=True)
class Disturbance:
    """One of them.

    Attributes:
        kind: where it lies.
        robot: what changes in the robot's configuration, named `table.key`.
        arena: changes a scenario, given as JSON values, and gives another.
    """

    kind: Kind
    robot: Mapping[str, Any] = field(default_factory=dict[str, Any])
    arena: Callable[[Arena], Arena] = _as_it_is


def hard_shadows(arena: Arena) -> Arena:
    """One strong lamp beside the arena, low, and little light from elsewhere: shadows as long as things are high twice.

    The floor in the light is about as bright as usual, in the shadow a sixth of that.
    """
    light = {"elevation_deg": 25.0, "distance_m": 3.0, "strength": 1.6, "ambient": 0.13}
    return {**arena, "light": {**arena["light"], **light}}


def floor_coloured(arena: Arena) -> Arena:
    """Every obstacle in the floor's own surface; walls keep theirs.

    The surface is named as often as there were surfaces, so that the same seed draws the same places and sizes.
    """
    floor = arena["arena"]["floor"]
    groups = [{**group, "surfaces": [floor] * len(group["surfaces"])} for group in arena["obstacles"]]
    return {**arena, "obstacles": groups}


def walked_in(arena: Arena) -> Arena:
    """One person in blue trousers walks about."""
    denim = {"name": "denim", "pattern": "speckle", "colours": ["#2b3d5c", "#41597f"], "period_m": 0.2}
    return {**arena, "surface": [*arena["surface"], denim], "people": [{"surface": "denim"}]}


def _pose(height_m: float, pitch_deg: float) -> Disturbance:
    return Disturbance("camera pose", {"simulation.camera_height_m": height_m, "simulation.pitch_deg": pitch_deg})


#: Usual are 12 cm and 46 degrees. From higher up, the pitch is such that the picture's lower edge still meets the floor
#: 3.4 cm before the camera; the upper edge then lies farther ahead than usual, so that all the usual floor is seen.
DISTURBANCES: Mapping[str, Disturbance] = {
    "camera at 60 cm": _pose(0.60, 58.4),
    "camera at 95 cm": _pose(0.95, 59.6),
    "pitch 10 deg flatter": _pose(0.12, 36.0),
    "pitch 10 deg steeper": _pose(0.12, 56.0),
    "half as bright": Disturbance("picture", {"simulation.exposure": 0.5}),
    "1.6 times as bright": Disturbance("picture", {"simulation.exposure": 1.6}),
    "out of focus": Disturbance("picture", {"simulation.blur_px": 1.5}),
    "smeared by motion": Disturbance("picture", {"simulation.shutter_s": 0.05}),
    "hard shadows": Disturbance("world", arena=hard_shadows),
    "obstacles like the floor": Disturbance("world", arena=floor_coloured),
    "a walking person": Disturbance("world", arena=walked_in),
}
