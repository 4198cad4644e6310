"""A long drive as plain arrays: the paper's Pioneer, a new angular speed every three seconds, 20 poses a second."""

import numpy as np

from llrp_online.motion_noise import MotionNoise
from replay.resolution import Drive
from replay.rule import LabelRule, OdometryLimits
from replay.targets import Targets

RATE_HZ = 20
SPEED_M_S, TURN_RAD_S, EVERY_S = 0.5, np.deg2rad(15), 3
STREAMS = [[0]]
LIMITS = OdometryLimits(max_gap_s=0.5, max_speed_m_s=3.0)
NOISE = MotionNoise(0.01, 0.01, 0.005)
GRID = Targets.grid([-3.0, 5.0, 0.5], [-4.0, 4.0, 0.5])
FINE = Targets.grid([-3.0, 5.0, 8 / 33], [-4.0, 4.0, 8 / 84])
RULE = LabelRule(position_tolerance_m=0.1, window_s=60.0)


def listed(count: int, heading: bool) -> Targets:
    """Targets all over the grid's area, on no grid."""
    random = np.random.default_rng(0)
    poses = random.uniform([-3, -4, -np.pi], [5, 4, np.pi], (count, 3))
    return Targets.listed(poses * [1, 1, float(heading)])


def pioneer(poses: int, rate_hz: int = RATE_HZ, streams: int = 1) -> Drive:
    """So many poses, with a reading of each stream and a frame at each."""
    random = np.random.default_rng(0)
    every = EVERY_S * rate_hz
    turns = random.uniform(-TURN_RAD_S, TURN_RAD_S, poses // every + 1).repeat(every)[:poses]
    yaw = np.cumsum(turns / rate_hz)
    step_m = SPEED_M_S / rate_hz
    path = np.stack([np.cumsum(step_m * np.cos(yaw)), np.cumsum(step_m * np.sin(yaw)), yaw], -1)
    path[:, 2] = (path[:, 2] + np.pi) % (2 * np.pi) - np.pi
    t_ns = np.arange(poses) * (10**9 // rate_hz)
    bits = random.integers(0, 2, (poses * streams, 1)).astype(np.int8)
    stream = np.tile(np.arange(streams), poses)
    return Drive(t_ns, path, None, t_ns.repeat(streams), stream, bits, t_ns)
