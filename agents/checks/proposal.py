"""A robot's TOML for a stranger's recording: what could be what, with thresholds from the values that it has."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agents.checks.survey import PICTURES, Candidate, Survey, Topic, usual_speed_m_s
from agents.topics import ODOMETRY_TYPE, relative_topic

_WIDTH = 80
#: A threshold is put where this share of the readings is near: rare enough to mean something, and still to be learned.
_NEAR_SHARE = 0.1
_GOOD_CAMERA, _BAD_CAMERA = ("rgb", "color", "front", "image"), ("depth", "infra", "stereo", "rear", "back", "down")
_GOOD_ODOMETRY, _BAD_ODOMETRY = ("odom",), ("truth", "amcl", "slam", "map", "gps", "global")


class Proposal(NamedTuple):
    """A configuration to begin with.

    Attributes:
        toml: its text, with comments; empty if something is missing.
        missing: what no topic could be, each with what was looked for.
    """

    toml: str
    missing: tuple[str, ...]


def propose(survey: Survey, name: str) -> Proposal:
    """From what a survey has found; `name` is the robot's, if its topics have no namespace.

    >>> propose(Survey(), "rover").missing[0]
    'camera: no topic with pictures that can be decoded (sensor_msgs/msg/CompressedImage or sensor_msgs/msg/Image)'
    """
    cameras = {topic: what for topic, what in survey.topics.items() if what.type in PICTURES and what.size}
    sensors = _sensors(survey)
    missing: list[str] = []
    if not cameras:
        missing.append(f"camera: no topic with pictures that can be decoded ({' or '.join(PICTURES)})")
    if not survey.poses:
        missing.append(f"odometry: no topic of {ODOMETRY_TYPE}")
    if not sensors:
        missing.append("short range: no LaserScan, Range, bumper or infrared message")
    if missing:
        return Proposal("", tuple(missing))
    camera = _best(cameras, _GOOD_CAMERA, _BAD_CAMERA)
    odometry = _best({topic: survey.topics[topic] for topic in survey.poses}, _GOOD_ODOMETRY, _BAD_ODOMETRY)
    chosen = [camera, odometry, *(candidate.topic for candidate, _ in sensors)]
    space = _namespace(chosen)
    robot = space or re.sub(r"\W", "_", name).strip("_").lower() or "robot"
    robot = robot if robot[0].isalpha() else f"robot_{robot}"
    parts = [
        *_head(survey, robot, set(chosen)),
        *_camera(survey.topics[camera], relative_topic(space, camera)),
        *_odometry(survey, odometry, relative_topic(space, odometry)),
        *_short_range(survey, sensors, space),
        *_targets(survey, odometry, sensors),
        *([f'[keys]\nnamespace = "{space}"'] if space else []),
    ]
    return Proposal("\n\n".join(parts) + "\n", ())


def _best(topics: dict[str, Topic], good: Sequence[str], bad: Sequence[str]) -> str:
    """The likeliest by its name, then compressed, then the one that comes most often."""

    def score(topic: str) -> tuple[int, bool, float]:
        name = topic.lower()
        return (
            sum(word in name for word in good) - 3 * sum(word in name for word in bad),
            name.endswith("compressed"),
            topics[topic].rate_hz,
        )

    return max(sorted(topics), key=score)


def _sensors(survey: Survey) -> list[tuple[Candidate, float]]:
    """Candidates that said anything, left to right, each with its threshold."""
    found: list[tuple[Candidate, float]] = []
    for kind in dict.fromkeys(candidate.type for candidate in survey.candidates):
        together = {c: values for c, values in survey.candidates.items() if c.type == kind and values}
        limit = _threshold(next(iter(together)), np.concatenate(list(together.values()))) if together else None
        found += [] if limit is None else [(candidate, limit) for candidate in together]
    return sorted(found, key=lambda pair: _side(pair[0].name))


def _side(name: str) -> float:
    """0 on the left to 4 on the right by what it is called; what does not say is in the middle."""
    middle = "center" in name or "centre" in name or "front" in name
    if "left" in name:
        return 1.0 if middle else 0.0
    return 2.0 if "right" not in name else 3.0 if middle else 4.0


def _threshold(candidate: Candidate, values: NDArray[np.float64]) -> float | None:
    """Of all sensors of a type, like `candidate`: two digits; None where no value is a number."""
    if candidate.touch:
        return 0.5
    known = values[~np.isnan(values)]
    finite = known[np.isfinite(known)]
    if not len(finite):
        return None
    share = _NEAR_SHARE if candidate.near_is_less else 1 - _NEAR_SHARE
    limit = float(np.quantile(known, share, method="nearest"))
    limit = limit if math.isfinite(limit) else float(finite.max())
    return float(f"{limit:.2g}")


def _namespace(topics: Sequence[str]) -> str:
    """What all topics begin with, if it is one word and a robot's name could be it."""
    first = {topic.removeprefix("/").partition("/")[0] for topic in topics}
    deep = all("/" in topic.removeprefix("/") for topic in topics)
    word = first.pop() if len(first) == 1 and deep else ""
    return word if re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", word) else ""


def _head(survey: Survey, robot: str, chosen: set[str]) -> Iterator[str]:
    others = [
        f"#   {topic}  {what.type}, {what.rate_hz:.1f} a second{f' ({what.fault})' if what.fault else ''}"
        for topic, what in sorted(survey.topics.items())
        if topic not in chosen
    ]
    lines = ["# Proposed by `llrp check`. Thresholds are where a tenth of the readings was near; targets are a guess."]
    lines += ["# Not used:", *others] if others else []
    yield "\n".join([*lines, "[robot]", f'name = "{robot}"'])


def _camera(what: Topic, topic: str) -> Iterator[str]:
    assert what.size is not None
    width, height = what.size
    rows = max(8, round(_WIDTH * height / width / 4) * 4)
    yield (
        f'[[camera]]\ntopic = "{topic}"\ntype = "{what.type}"\n'
        f"width = {_WIDTH} # its own pictures are {width} x {height}\nheight = {rows}"
    )


def _odometry(survey: Survey, odometry: str, topic: str) -> Iterator[str]:
    rate_hz = survey.topics[odometry].rate_hz
    usual, fastest = usual_speed_m_s(survey.poses[odometry])
    gap_s = max(0.5, float(f"{3 / rate_hz:.1g}")) if rate_hz else 0.5
    limit = max(0.2, float(f"{1.5 * fastest:.1g}"))
    yield (
        f'[odometry]\ntopic = "{topic}"\nmax_gap_s = {gap_s}\n'
        f"max_speed_m_s = {limit} # it drives at {usual:.2f} m/s, {fastest:.2f} at most"
    )


def _short_range(survey: Survey, sensors: Sequence[tuple[Candidate, float]], space: str) -> Iterator[str]:
    names = [candidate.name for candidate, _ in sensors]
    twice = {name for name in names if names.count(name) > 1}
    unique = [f"{name}_{number}" if name in twice else name for number, name in enumerate(names)]
    swaps = _swaps({name: candidate.mirror for (candidate, _), name in zip(sensors, unique, strict=True)})
    for (candidate, limit), name in zip(sensors, unique, strict=True):
        latest = "latest " if candidate.touch and survey.is_event(candidate.topic) else ""
        values = [value for value in survey.candidates[candidate] if not math.isnan(value)] or [math.nan]
        side = "below" if candidate.near_is_less else "above"
        lines = [
            "[[short_range]]",
            f'name = "{name}"',
            f'topic = "{relative_topic(space, candidate.topic)}"',
            f'type = "{candidate.type}"',
            f'field = "{latest}{candidate.field}"',
            f"{side} = {limit} # values {min(values):.3g} to {max(values):.3g}",
        ]
        yield "\n".join([*lines, *([f'swap = "{swaps[name]}"'] if swaps else [])])
    if not swaps and len(unique) > 1:
        yield "[augmentation]\nflip = 0.0 # if the robot has a mirror image: give each sensor its `swap` instead"


def _swaps(mirrors: Mapping[str, str]) -> dict[str, str]:
    """Each sensor's mirror image as is known, or by what they are called; empty if one has none."""

    def other(name: str) -> str:
        return re.sub("left|right", lambda found: "right" if found[0] == "left" else "left", name)

    swaps = {name: mirror or other(name) for name, mirror in mirrors.items()}
    sided = any(name != swap for name, swap in swaps.items())
    return swaps if sided and all(swap in swaps for swap in swaps.values()) else {}


def _targets(survey: Survey, odometry: str, sensors: Sequence[tuple[Candidate, float]]) -> Iterator[str]:
    """As far as five times what the sensors feel, at 16 places; the window is long enough to get there and back."""
    reaches = [limit for candidate, limit in sensors if candidate.near_is_less]
    stop_m = min(2.0, max(0.3, round(5 * max(reaches), 1))) if reaches else 1.0
    step_m = float(f"{stop_m / 15:.1g}")
    stop_m = round(step_m * 15, 3)
    usual, _ = usual_speed_m_s(survey.poses[odometry])
    window_s = float(min(60, max(15, round(4 * stop_m / usual)))) if usual else 15.0
    yield f'[targets]\nkind = "line"\nstart_m = 0.0\nstop_m = {stop_m}\nstep_m = {step_m}'
    yield (
        f"[labels]\nposition_tolerance_m = {float(f'{step_m / 2:.2g}')}\nheading_tolerance_rad = 0.2\n"
        f'window = "fixed"\nwindow_s = {window_s} # how long your odometry is good for: `llrp window`'
    )
