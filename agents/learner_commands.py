"""What the learner does at a request: JSON such as {"command": "save", "path": "runs/a"}; the reply is JSON, too.

Some change it, some only ask. What is asked for is worked out then and there, between two training steps.
"""

import base64
import inspect
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_origin

import numpy as np
from numpy.typing import NDArray

from agents import messages
from llrp_online.learner import Learner

#: Pictures of the memory that one reply holds at most: they are to be looked at, and the learner waits meanwhile.
_MOST_PICTURES = 64
_JPEG_QUALITY = 80

Call = Callable[[Callable[[Learner], Any]], Any]


def obey(call: Call, data: bytes) -> bytes:
    """Obey a request; `call` runs a function of the learner where the learner lives. ValueError: not understood."""
    name, command, arguments = _understood(data)
    result = call(lambda learner: command(learner, **arguments))
    return json.dumps({"command": name, "result": result}).encode()


def _understood(data: bytes) -> tuple[str, Callable[..., Any], dict[str, Any]]:
    """Name, command and its arguments; ValueError says what was expected."""
    try:
        request = json.loads(data)
    except ValueError as error:
        raise ValueError(f'a request is JSON such as {{"command": "pause"}}, got {data[:40]!r}') from error
    if not isinstance(request, dict) or request.get("command") not in list(_COMMANDS):
        raise ValueError(f'expected {{"command": one of {sorted(_COMMANDS)}, ...}}, got {request!r}')
    name = str(request.pop("command"))
    parameters = list(inspect.signature(_COMMANDS[name]).parameters.items())[1:]
    wanted = {key: get_origin(value.annotation) or value.annotation for key, value in parameters}
    if {key: type(value) for key, value in request.items()} != wanted:
        words = ", ".join(f"{key} ({kind.__name__})" for key, kind in wanted.items()) or "nothing else"
        raise ValueError(f"{name}: expected {words} beside the command, got {request!r}")
    return name, _COMMANDS[name], request


# --- what changes it


def _pause(learner: Learner) -> bool:
    learner.paused = True
    return learner.paused


def _resume(learner: Learner) -> bool:
    learner.paused = False
    return learner.paused


def _save(learner: Learner, path: str) -> str:
    learner.save(Path(path))
    return path


def _load(learner: Learner, path: str) -> str:
    learner.load(Path(path))
    return path


def _reset(learner: Learner) -> None:
    learner.reset()


def _roll_back(learner: Learner, version: int) -> int:
    return learner.roll_back(version).number


# --- what only asks


def _labels(learner: Learner, t_ns: list[int], ids: list[int]) -> list[dict[str, Any] | None]:
    """Labels as now known of frames, each by its time, and by its id (-1: not known) once its window has closed."""
    found = [learner.labels_of(int(t), int(i)) for t, i in zip(t_ns, ids, strict=True)]
    return [None if frame is None else {"id": frame[0], "labels": frame[1].tolist()} for frame in found]


def _explain(learner: Learner, t_ns: int) -> dict[str, Any] | None:
    """Which reading gave each label of a frame that waits; None if no frame of that time does."""
    found = learner.labeller.store.explain(t_ns)
    return None if found is None else found.as_json()


def _curves(learner: Learner) -> dict[str, Any]:
    """What each robot minute was like, and when the world changed."""
    events = zip(learner.drift_lived_s, learner.drift_events, strict=True)
    return {
        "minutes": [entry.as_json() for entry in learner.minutes()],
        "drift_events": [{"robot_s": lived_s, "band": event.band} for lived_s, event in events],
    }


def _memory(learner: Learner, pictures: int) -> dict[str, Any]:
    """Counts by target, sensor and class of all frames kept, and some of their pictures."""
    counts = learner.buffer.class_counts
    found = learner.buffer.glance(max(1, min(pictures, _MOST_PICTURES)))
    shown: list[dict[str, Any]] = []
    if found is not None:
        ids, batch = found
        for frame_id, picture, labels in zip(ids.tolist(), batch.pictures, batch.labels, strict=True):
            known, positive = int((labels >= 0).sum()), int((labels == 1).sum())
            shown.append({"id": frame_id, "jpeg": _jpeg(picture), "known": known, "positive": positive})
    return {"frames": len(learner.buffer), "sizes": learner.buffer.sizes, "counts": counts.tolist(), "pictures": shown}


def _jpeg(picture: NDArray[np.uint8]) -> str:
    """(H, W, 3 * cameras) as a JPEG in base64, the cameras side by side."""
    cameras = np.split(picture, picture.shape[2] // 3, axis=2)
    return base64.b64encode(messages.jpeg(np.concatenate(cameras, axis=1), _JPEG_QUALITY)).decode("ascii")


_COMMANDS: dict[str, Callable[..., Any]] = {
    "pause": _pause,
    "resume": _resume,
    "save": _save,
    "load": _load,
    "reset": _reset,
    "roll_back": _roll_back,
    "labels": _labels,
    "explain": _explain,
    "curves": _curves,
    "memory": _memory,
}
