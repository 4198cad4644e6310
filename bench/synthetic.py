"""A drive made of nothing but arithmetic: as many messages as wanted, quickly, with a few hundred distinct pictures.

The robot drives in a circle at 0.1 m/s; odometry, ranges and a picture come 20 times a second, as from the Thymio.
"""

import math
import struct
from collections.abc import Iterator

import cv2
import numpy as np

from agents import messages
from agents.robots.wire import ODOMETRY_TYPE, PICTURE_TYPE, RANGE_TYPE
from llrp_online.events import OdometrySample
from replay.recording import Message

RATE_HZ = 20
START_NS = 10**12
PICTURE_TOPIC = "/thymio/camera/image/compressed"
_SPEED_M_S, _TURN_RAD_S = 0.1, 0.1
_DISTINCT = 256
_STAMP = struct.Struct("<iI")  # where a CDR message that begins with a header has it: after four bytes


def drive(seconds: float, size: tuple[int, int] = (80, 64), start_ns: int = START_NS) -> Iterator[Message]:
    """The messages of each tick: odometry, ranges, a picture of `size` (width, height)."""
    random = np.random.default_rng(0)
    pictures = [bytearray(messages.encode(messages.compressed_image(0, scene, quality=95))) for scene in _scenes(size)]
    for tick in range(round(seconds * RATE_HZ)):
        t_ns = start_ns + tick * 10**9 // RATE_HZ
        yaw = _TURN_RAD_S * tick / RATE_HZ
        radius_m = _SPEED_M_S / _TURN_RAD_S
        pose = np.array([radius_m * math.sin(yaw), -radius_m * math.cos(yaw), math.remainder(yaw, 2 * math.pi)])
        odometry = messages.odometry(OdometrySample(t_ns, pose, 1e-6 * tick * np.eye(3)), (_SPEED_M_S, _TURN_RAD_S))
        yield Message("/thymio/odom", ODOMETRY_TYPE, t_ns, messages.encode(odometry))
        ranges = np.where(random.random(5) < 0.1, 0.05, math.inf)
        scan = messages.laser_scan(t_ns, ranges, (-0.7, 0.7), (0.0, 0.1))
        yield Message("/thymio/range", RANGE_TYPE, t_ns, messages.encode(scan))
        picture = pictures[tick % _DISTINCT]
        _STAMP.pack_into(picture, 4, *divmod(t_ns, 10**9))
        yield Message(PICTURE_TOPIC, PICTURE_TYPE, t_ns, bytes(picture))


def _scenes(size: tuple[int, int]) -> Iterator[np.ndarray]:
    """Patches of colour with a camera's noise."""
    random = np.random.default_rng(1)
    for _ in range(_DISTINCT):
        patches = random.integers(0, 255, (12, 16, 3), np.uint8)
        smooth = cv2.resize(patches, size, interpolation=cv2.INTER_CUBIC)
        yield np.clip(smooth + random.normal(0, 4, smooth.shape), 0, 255).astype(np.uint8)
