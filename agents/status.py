"""What agents say of themselves, as DiagnosticArray: one key a figure, lists and mappings as JSON."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from agents import messages
from agents.topics import STATUS_TYPE
from llrp_online.prequential import Band
from llrp_online.status import LearnerStatus


@dataclass(frozen=True)
class PerceiverStatus:
    """What the perceiver says of itself.

    Attributes:
        frames: predicted so far.
        frames_per_s: lately, by the wall clock.
        p50_ms: median time from the frame's sending to the prediction's, lately.
        p99_ms: what 99 % stay below.
        p999_ms: what 99.9 % stay below.
        version: of the weights in use; None before the first.
        drops: what could not be used.
    """

    frames: int
    frames_per_s: float
    p50_ms: float
    p99_ms: float
    p999_ms: float
    version: int | None
    drops: dict[str, int] = field(default_factory=dict[str, int])


@dataclass(frozen=True)
class RobotStatus:
    """What the simulated robot says of itself; a real robot could not know its collisions.

    Attributes:
        robot_s: sensor time since it began.
        collisions: contacts so far.
        metres: driven so far, truly.
        stopped: it stands still because a person said so.
    """

    robot_s: float
    collisions: int
    metres: float
    stopped: bool = False


@dataclass(frozen=True)
class ControllerStatus:
    """What a controller says of itself.

    Attributes:
        behaviour: its name.
        robot_s: sensor time since it began.
        stopped: it commands standing still because a person said so.
    """

    behaviour: str
    robot_s: float
    stopped: bool


#: What a Thymio says of its camera when there is nothing to mend.
CAMERA_LIVE, CAMERA_NONE = "live", "none configured"


@dataclass(frozen=True)
class ThymioStatus:
    """What a real Thymio says of itself.

    Attributes:
        robot_s: since it began.
        metres: rolled so far, by its odometry.
        link: "connected", or what is wrong and what to do.
        camera: "live", "none configured", or what is wrong and what to do.
        drops: commands that were none.
        stopped: it stands still because a person said so.
    """

    robot_s: float
    metres: float
    link: str
    camera: str
    drops: dict[str, int] = field(default_factory=dict[str, int])
    stopped: bool = False


def encode(name: str, t_ns: int, values: Mapping[str, Any]) -> bytes:
    """A flat mapping of JSON values as the bytes of a DiagnosticArray."""
    texts = {key: json.dumps(value) for key, value in values.items()}
    return messages.encode(messages.diagnostic_array(t_ns, name, texts))


def decode(data: bytes) -> dict[str, Any]:
    """The other way; MessageError where it is none.

    >>> decode(encode("robot", 0, {"robot_s": 1.5, "known": [1, 2], "version": None}))
    {'robot_s': 1.5, 'known': [1, 2], 'version': None}
    """
    values = messages.read_diagnostics(messages.decode(STATUS_TYPE, data))
    return {key: json.loads(value) if isinstance(value, str) else value for key, value in values.items()}


def decode_robot(data: bytes) -> RobotStatus | ThymioStatus:
    """What a robot says, simulated or real; TypeError where it is neither's.

    >>> decode_robot(encode("robot", 0, {"robot_s": 1.0, "collisions": 0, "metres": 0.1})).metres
    0.1
    """
    values = decode(data)
    return ThymioStatus(**values) if "link" in values else RobotStatus(**values)


def encode_learner(status: LearnerStatus, t_ns: int) -> bytes:
    """The learner's status."""
    return encode("learner", t_ns, {**asdict(status), "bands": [band._asdict() for band in status.bands]})


def decode_learner(data: bytes) -> LearnerStatus:
    """The other way."""
    values = decode(data)
    values["bands"] = [Band(**band) for band in values["bands"]]
    return LearnerStatus(**values)
