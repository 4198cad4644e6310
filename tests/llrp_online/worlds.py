"""A world small enough to be learned in seconds: a robot on a line, driving towards two walls and back.

Its two sensors feel the left and the right wall, its camera shows them: in each half of the picture the bright part
reaches down the further, the nearer that half's wall is. The robot never turns, so going back it stands where it saw.
"""

import numpy as np

from llrp_online.configuration import RobotConfiguration, validate
from llrp_online.events import OdometrySample, Picture, Reading
from llrp_online.learner import Learner

TICK_NS = 50_000_000
WALLS_M = (1.0, 1.1)  # where the left and the right wall stand
RANGE_M = 0.25  # a sensor's bit is 1 below it
SIDE = 16  # rows and columns of a picture
SPEED_M_S = 0.3


def configuration(**tables) -> RobotConfiguration:
    """The robot's; each keyword replaces keys of a table, or a whole table if it is a list."""
    raw = {
        "robot": {"name": "bot"},
        "camera": [{"topic": "camera", "width": SIDE, "height": SIDE}],
        "odometry": {"max_speed_m_s": 1.0, "max_delay_s": 0.2},
        "short_range": [
            {"name": "left", "field": "ranges[1]", "below": RANGE_M, "swap": "right"},
            {"name": "right", "field": "ranges[0]", "below": RANGE_M, "swap": "left"},
        ],
        "targets": {"kind": "line", "start_m": 0.0, "stop_m": 0.4, "step_m": 0.2},
        "labels": {"position_tolerance_m": 0.05, "heading_tolerance_rad": 0.2, "window_s": 4.0},
        "memory": {"store_mb": 10.0, "budget_mb": 1.0, "recent_frames": 40},
        "training": {"batch": 16, "steps_per_second": 5.0, "warmup_frames": 8},
        "publishing": {"every_s": 2.0, "held_out_share": 0.2, "held_out_block_s": 1.0, "held_out_frames": 16},
    }
    for name, table in tables.items():
        raw[name] = {**raw.get(name, {}), **table} if isinstance(table, dict) else table
    return validate(raw, RobotConfiguration, "test")


def events(seconds: float, seed: int = 0, *, start_ns: int = 10**9, blind: bool = False) -> list:
    """All that the robot senses while it drives for so long: odometry and readings at 20 Hz, pictures at 10 Hz.

    Args:
        seconds: how long.
        seed: of where it turns back, and of the camera's noise.
        start_ns: the sensors' clock at the start.
        blind: the camera shows noise alone.
    """
    rng = np.random.default_rng(seed)
    x_m, goal_m, found = 0.0, 0.9, []
    for tick in range(round(seconds * 1e9 / TICK_NS)):
        t_ns = start_ns + tick * TICK_NS
        step_m = SPEED_M_S * TICK_NS * 1e-9
        if abs(goal_m - x_m) < step_m:
            goal_m = rng.uniform(0.7, 0.95) if goal_m < 0.5 else rng.uniform(0.0, 0.4)
        x_m += step_m * np.sign(goal_m - x_m)
        found.append(OdometrySample(t_ns, np.array([x_m, 0.0, 0.0])))
        if tick % 2 == 0:
            found.append(Picture(t_ns, 0, picture(x_m, rng, blind=blind)))
        found.append(Reading(t_ns, "range", bits(x_m)))
    return found


def bits(x_m: float) -> np.ndarray:
    """(2,) int8: what the sensors feel at `x_m`."""
    return np.array([wall_m - x_m < RANGE_M for wall_m in WALLS_M], np.int8)


def picture(x_m: float, rng: np.random.Generator, *, blind: bool = False) -> np.ndarray:
    """(SIDE, SIDE, 3) uint8: what the camera sees at `x_m`."""
    rows = np.arange(SIDE)[:, None]
    reach = [SIDE * (1.0 - (wall_m - x_m) / max(WALLS_M)) for wall_m in WALLS_M]
    halves = [np.where(rows < reach_rows, 180.0, 60.0).repeat(SIDE // 2, 1) for reach_rows in reach]
    seen = np.full((SIDE, SIDE), 120.0) if blind else np.concatenate(halves, 1)
    return np.clip(seen[:, :, None] + rng.normal(0, 10, (SIDE, SIDE, 3)), 0, 255).astype(np.uint8)


def live(learner: Learner, stream: list) -> Learner:
    """Let the learner live through the events, in virtual time."""
    for event in stream:
        learner.take(event)
        while learner.due():
            learner.step()
    return learner
