"""What goes to a browser: a message with all that has changed since the last that this browser got.

A message is a length (uint32, little-endian), so many bytes of JSON, then the pictures that the JSON lists under
"shots". A browser that was slow for a while gets one message with all of it, and what is no longer kept is left out.
"""

import base64
import json
import math
import struct
import time
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.dashboard.collector import Collector
from agents.dashboard.past import EVERY_S, Past
from agents.messages import MessageError
from llrp_online.configuration import RobotConfiguration

_LENGTH = struct.Struct("<I")
_SLOWLY_S = 0.5


@dataclass
class Cursor:
    """What a browser has got.

    Attributes:
        epoch: of the ground.
        points: of the path.
        fired: sensors.
        past: revision of the past frames.
        answers: revision of the learner's answers.
        picture_ns: time of the pictures.
        slowly_s: when it last got what changes slowly.
    """

    epoch: int = -1
    points: int = 0
    fired: int = 0
    past: int = 0
    answers: int = 0
    picture_ns: int = -1
    slowly_s: float = -math.inf


def hello(configuration: RobotConfiguration) -> dict[str, Any]:
    """What does not change: the robot, its targets, its sensors, its rule."""
    rule = configuration.labels.rule()
    return {
        "robot": configuration.robot.name,
        "kind": configuration.targets.kind,
        "targets": configuration.targets.build().poses.tolist(),
        "sensors": configuration.sensors,
        "topics": [sensor.topic for sensor in configuration.short_range],
        "cameras": len(configuration.camera),
        "window": rule.window,
        "window_s": rule.window_s,
        "gate_m": rule.gate_m,
        "tolerance_m": rule.position_tolerance_m,
        "stale_s": configuration.transport.stale_s,
        "past_every_s": EVERY_S,
    }


def update(collector: Collector, cursor: Cursor) -> bytes:
    """The next message for a browser, which has then got it."""
    now_s = time.monotonic()
    with collector.lock:
        told = _quickly(collector, cursor, now_s)
        files = _pictures(collector, cursor, told)
        if now_s - cursor.slowly_s >= _SLOWLY_S:
            cursor.slowly_s = now_s
            told |= _slowly(collector, cursor, now_s)
    text = json.dumps(told, separators=(",", ":")).encode()
    return b"".join((_LENGTH.pack(len(text)), text, *files))


def explained(found: dict[str, Any], past: Past) -> dict[str, Any]:
    """An explanation for a browser, whose numbers are too short for nanoseconds: readings by the time between, in s."""
    between = [
        [None if when is None else round((when - found["t_ns"]) * 1e-9, 4) for when in row]
        for row in found["reading_ns"]
    ]
    kept = {name: value for name, value in found.items() if name not in ("t_ns", "reading_ns")}
    return {
        **kept,
        "between_s": between,
        "robot_s": past.robot_s,
        "key": past.key,
        "prediction": _packed(past.prediction),
    }


def _quickly(collector: Collector, cursor: Cursor, now_s: float) -> dict[str, Any]:
    ground = collector.ground
    told: dict[str, Any] = {"stopped": collector.stopped, "obeyed": dict(collector.obeyed)}
    if cursor.epoch != ground.epoch:
        cursor.epoch, cursor.points, cursor.fired = ground.epoch, 0, 0
        told["anew"] = True
    if ground.now_ns is not None:
        told["robot_s"] = round(ground.robot_s(ground.now_ns), 3)
        told["pose"] = _rounded(ground.pose)
    # No more than are kept: of what a slow browser has missed, the newest.
    points = min(ground.points - cursor.points, len(ground.path))
    if points:
        told["path"] = [_rounded(p) for p in islice(ground.path, len(ground.path) - points, None)]
    fired = min(ground.fired_count - cursor.fired, len(ground.fired))
    if fired:
        told["fired"] = [_rounded(f) for f in islice(ground.fired, len(ground.fired) - fired, None)]
    cursor.points, cursor.fired = ground.points, ground.fired_count
    told["ages"] = {name: [_rounded_number(h.age_s(now_s)), round(h.per_s, 1)] for name, h in collector.heard.items()}
    return told


def _pictures(collector: Collector, cursor: Cursor, told: dict[str, Any]) -> list[bytes]:
    """The pictures, if they are new, and what was predicted of them."""
    shots = collector.shots
    if shots is None or shots[0].t_ns == cursor.picture_ns:
        return []
    cursor.picture_ns = shots[0].t_ns
    try:
        told["shots"] = [[shot.media_type, len(shot.file)] for shot in shots]
    except MessageError:
        collector.sights.unreadable += 1
        return []
    told["shots_s"] = round(collector.ground.robot_s(shots[0].t_ns), 3)
    if collector.predicted and collector.prediction is not None:
        told["prediction"] = _packed(collector.prediction)
    return [shot.file for shot in shots]


def _slowly(collector: Collector, cursor: Cursor, now_s: float) -> dict[str, Any]:
    told: dict[str, Any] = {
        "agents": {name: there for name, there in collector.agents.items() if name != "dashboard"},
        "findings": [vars(finding) for finding in collector.findings],
        "window": None if collector.window is None else list(map(_rounded_number, collector.window)),
        "heard": {name: round(now_s - heard_s, 1) for name, heard_s in collector.heard_s.items()},
    }
    for name in ("learner", "perceiver", "controller", "robot"):
        one = getattr(collector, name)
        told[f"{name}_status"] = None if one is None else _finite(vars(one))
    if collector.learner is not None:
        told["learner_status"]["bands"] = [band._asdict() for band in collector.learner.bands]
    changed = collector.pasts.since(cursor.past)
    told["oldest"] = collector.pasts.oldest_key
    if changed:
        told["past"] = [_past(past) for past in changed]
        cursor.past = collector.pasts.revision
    if collector.questions.revision != cursor.answers:
        cursor.answers = collector.questions.revision
        told["curves"], told["memory"] = collector.questions.curves, collector.questions.memory
    return told


def _past(past: Past) -> dict[str, Any]:
    return {
        "key": past.key,
        "robot_s": round(past.robot_s, 2),
        "prediction": _packed(past.prediction),
        "labels": None if past.labels is None else _packed(past.labels.astype(np.uint8)),
        "closed": past.closed,
    }


def _packed(values: NDArray[np.uint8]) -> str:
    """Bytes, row by row, in base64; a label that is unknown, -1, is 255."""
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")


def _rounded(values: Any) -> list[float | bool]:
    return [round(value, 4) if isinstance(value, float) else value for value in values]


def _rounded_number(value: float | None) -> float | None:
    return None if value is None else round(value, 4)


def _finite(values: Any) -> Any:
    """NaN is no JSON."""
    if isinstance(values, dict):
        return {str(key): _finite(value) for key, value in values.items()}
    return None if isinstance(values, float) and not math.isfinite(values) else values
