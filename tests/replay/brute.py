"""The label rule read once more, word by word and in plain Python: what the store is held against."""

import itertools
import math
from dataclasses import dataclass

from replay.rule import LabelRule, OdometryLimits

NANO = 1e-9
PICOMETRE = 1e-12


@dataclass
class Odometry:
    t_ns: int
    pose: tuple[float, float, float]


@dataclass
class Reading:
    t_ns: int
    stream: int
    bits: list[int]


@dataclass
class Frame:
    t_ns: int
    frame_id: int


def wrap(angle):
    return math.atan2(math.sin(angle), math.cos(angle))


def trajectories(odometry, limits):
    """The number of the trajectory each sample belongs to."""
    numbers = [0]
    for a, b in itertools.pairwise(odometry):
        seconds = (b.t_ns - a.t_ns) * NANO
        metres = math.hypot(b.pose[0] - a.pose[0], b.pose[1] - a.pose[1])
        numbers.append(numbers[-1] + (seconds > limits.max_gap_s or metres > limits.max_speed_m_s * seconds))
    return numbers


def locate(t_ns, odometry, numbers):
    """(pose, trajectory) at a time, or None."""
    for i, sample in enumerate(odometry):
        if sample.t_ns == t_ns:
            return sample.pose, numbers[i]
        if sample.t_ns > t_ns:
            if i == 0 or numbers[i - 1] != numbers[i]:
                return None
            a, b = odometry[i - 1], sample
            f = (t_ns - a.t_ns) / (b.t_ns - a.t_ns)
            pose = (
                a.pose[0] + f * (b.pose[0] - a.pose[0]),
                a.pose[1] + f * (b.pose[1] - a.pose[1]),
                a.pose[2] + f * wrap(b.pose[2] - a.pose[2]),
            )
            return pose, numbers[i]
    return None


def labels(frame, odometry, readings, targets, streams, rule: LabelRule, limits: OdometryLimits, allowed=None):
    """The acceptable answers for each stream and target of a frame; None for a frame without a pose.

    A dictionary (stream, target) -> list of acceptable winners, None standing for "unknown". There is more than one
    only where rounding decides: candidates whose distances differ by less than a picometre without being equal.
    `allowed(frame, reading)` narrows the candidates: the drift window's gate.
    """
    odometry = sorted(odometry, key=lambda o: o.t_ns)
    numbers = trajectories(odometry, limits) if odometry else []
    here = locate(frame.t_ns, odometry, numbers)
    if here is None:
        return None
    (fx, fy, fyaw), number = here
    candidates = {(stream, j): [] for stream in range(len(streams)) for j in range(len(targets))}
    for reading in readings:
        apart = abs(reading.t_ns - frame.t_ns)
        there = locate(reading.t_ns, odometry, numbers)
        if apart > rule.window_s * 1e9 or there is None or there[1] != number:
            continue
        if allowed is not None and not allowed(frame, reading):
            continue
        (rx, ry, ryaw), _ = there
        x = math.cos(fyaw) * (rx - fx) + math.sin(fyaw) * (ry - fy)
        y = math.cos(fyaw) * (ry - fy) - math.sin(fyaw) * (rx - fx)
        for j, (tx, ty, tyaw) in enumerate(targets):
            if rule.heading_tolerance_rad is not None and abs(wrap(ryaw - fyaw - tyaw)) > rule.heading_tolerance_rad:
                continue
            candidates[reading.stream, j].append((math.hypot(x - tx, y - ty), apart, reading.t_ns, reading))
    return {slot: winners(found, rule.position_tolerance_m) for slot, found in candidates.items()}


def winners(candidates, tolerance_m):
    if not candidates or min(candidates)[0] > tolerance_m + PICOMETRE:
        return [None]
    nearest = min(c[0] for c in candidates)
    near = [c for c in candidates if c[0] <= nearest + PICOMETRE]
    tied = [min(near, key=lambda c: c[1:3])] if len({c[0] for c in near}) == 1 else near
    answers = [c[3] for c in tied]
    return [*answers, None] if abs(nearest - tolerance_m) < PICOMETRE else answers


def accepts(answer, said, streams):
    """Does a (T, S) array of labels agree with `labels`' answer?"""
    if answer is None:
        return bool((said == -1).all())
    return all(
        any(
            said[j, sensors].tolist() == ([-1] * len(sensors) if w is None else list(w.bits)) for w in answer[stream, j]
        )
        for stream, sensors in enumerate(streams)
        for j in range(len(said))
    )
