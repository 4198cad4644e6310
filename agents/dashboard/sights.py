"""What the cameras saw last: the pictures as they came, so that nothing is decoded for those who only pass them on."""

from collections import deque
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from agents import messages
from agents.messages import MessageError
from agents.transport import Received
from llrp_online.configuration import RobotConfiguration

#: Pictures of a camera that may wait for the prediction made of them.
KEPT = 16
#: A message begins with four bytes that say how it is written, and those of ROS that have a header with its stamp.
_STAMP_ENDS = 12
_COMPRESSED = "sensor_msgs/msg/CompressedImage"
_JPEG_QUALITY = 80
_WIDEST_PX = 640
_TYPES = {b"\xff\xd8": "image/jpeg", b"\x89P": "image/png"}


@dataclass(frozen=True, eq=False)
class Shot:
    """A picture of one camera.

    Attributes:
        t_ns: the sensor's time.
        raw: a file that a browser knows, or the message of a picture that is none.
        type: ROS type of that message; empty if `raw` is a file.
    """

    t_ns: int
    raw: bytes
    type: str

    @cached_property
    def file(self) -> bytes:
        """The picture as a file that a browser knows; a raw one is made one now. MessageError where it is none."""
        if not self.type:
            return self.raw
        pixels = messages.picture(messages.decode(self.type, self.raw))
        if pixels.shape[1] > _WIDEST_PX:
            size = _WIDEST_PX, round(pixels.shape[0] * _WIDEST_PX / pixels.shape[1])
            pixels = np.asarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA), np.uint8)
        return messages.jpeg(pixels, _JPEG_QUALITY)

    @property
    def seen(self) -> bytes:
        """What the camera saw, without when: two of these are equal if the pictures are."""
        return self.raw[_STAMP_ENDS:] if self.type else self.raw

    @property
    def media_type(self) -> str:
        """What a browser calls it."""
        return _TYPES[self.file[:2]]


class Sights:
    """The newest pictures of each camera.

    Args:
        configuration: the robot's.

    Attributes:
        same: for each camera, how many pictures in a row were the same to the last bit: a camera that hangs.
        unreadable: how many could not be used.
    """

    def __init__(self, configuration: RobotConfiguration) -> None:
        self._rings: list[deque[Shot]] = [deque(maxlen=KEPT) for _ in configuration.camera]
        self._types = [camera.type for camera in configuration.camera]
        self._tolerance_ns = round(configuration.robot.camera_sync_s * 1e9)
        self.same = [0] * len(configuration.camera)
        self.unreadable = 0

    def add(self, camera: int, message: Received) -> bool:
        """Take in a message of a camera; False if it is no picture."""
        try:
            shot = _shot(message, message.type or self._types[camera])
        except MessageError:
            self.unreadable += 1
            return False
        ring = self._rings[camera]
        self.same[camera] = self.same[camera] + 1 if ring and ring[-1].seen == shot.seen else 0
        ring.append(shot)
        return True

    def newest(self) -> tuple[Shot, ...] | None:
        """The newest of each camera; None before all have one."""
        return tuple(ring[-1] for ring in self._rings) if all(self._rings) else None

    def at(self, t_ns: int) -> tuple[Shot, ...] | None:
        """What each camera saw at this time, the first one's; None where that is not kept."""
        found: list[Shot] = []
        for index, ring in enumerate(self._rings):
            nearest = min(ring, key=lambda shot: abs(shot.t_ns - t_ns), default=None)
            if nearest is None or abs(nearest.t_ns - t_ns) > (self._tolerance_ns if index else 0):
                return None
            found.append(nearest)
        return tuple(found)


def _shot(message: Received, type_name: str) -> Shot:
    flat = messages.flat_picture(message.data) if type_name == _COMPRESSED else None
    if flat is not None and flat.data[:2] in _TYPES:
        return Shot(flat.t_ns, flat.data, "")
    t_ns = messages.stamp_ns(type_name, message.data)
    if t_ns is None:
        raise MessageError(f"expected a picture with a header, got {type_name}")
    return Shot(t_ns, message.data, type_name)
