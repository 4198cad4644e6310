"""A camera through OpenCV: USB, a file or a network stream; the newest picture, stamped when it was grabbed.

A thread of its own takes every picture off the camera as soon as it is there, so that none waits in a driver's queue
and grows old, and decodes only those that are sent. It opens the camera anew when it is gone, and says what is wrong
when nothing, or always the same, comes.
"""

import logging
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from agents import status
from agents.robots.thymio.clock import HostClock
from llrp_online.configuration import Thymio

logger = logging.getLogger(__name__)

Pixels = NDArray[np.uint8]

_RETRY_S = 1.0
_NETWORK_TIMEOUT_MS = 3000
_CLOSE_S = 1.0
_FILE_RATE_HZ = 30.0  # of a file that does not say


class Camera:
    """Grabs pictures and hands those that are due to `put`, from a thread of its own.

    What is wrong with the camera never comes as an exception: see `state`.

    Args:
        settings: [thymio].
        size: (width, height) of the pictures handed on.
        clock: stamps them.
        put: takes a stamp [ns] and a picture (height, width, 3) uint8 RGB.
    """

    def __init__(
        self, settings: Thymio, size: tuple[int, int], clock: HostClock, put: Callable[[int, Pixels], None]
    ) -> None:
        self._settings, self._size, self._clock, self._put = settings, size, clock, put
        self._delay_ns = round(settings.camera_delay_s * 1e9)
        self._stop = threading.Event()
        self._trouble = "opening"
        self._fresh_s = time.monotonic()  # when a picture came last that was another than the one before
        self._before: Pixels | None = None
        self.sent = 0
        self._thread = threading.Thread(target=self._run, name="camera", daemon=True)

    def start(self) -> None:
        """Begin."""
        if self._settings.camera:
            self._thread.start()

    def close(self) -> None:
        """No picture is handed on after this."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(_CLOSE_S)  # one that hangs in a driver ends with the process

    @property
    def state(self) -> str:
        """`status.CAMERA_LIVE`, `CAMERA_NONE`, or what is wrong and what to do."""
        if not self._settings.camera:
            return status.CAMERA_NONE
        if self._trouble:
            return self._trouble
        still_s = time.monotonic() - self._fresh_s
        if still_s > self._settings.camera_frozen_s:
            return f"frozen for {still_s:.0f} s: the same picture, or none: take off the cap, plug it in anew"
        return status.CAMERA_LIVE

    def _run(self) -> None:
        while not self._stop.is_set():
            capture = self._open()
            try:
                if capture.isOpened():
                    self._grab_from(capture)
                else:
                    self._trouble = _why_not_opened(self._settings.camera)
            except cv2.error as error:
                self._trouble = f"camera {self._settings.camera} cannot be read: {error.err}; trying again"
            capture.release()
            self._stop.wait(_RETRY_S)

    def _open(self) -> cv2.VideoCapture:
        source = self._settings.camera
        if source.isdigit() and sys.platform == "linux" and not Path(f"/dev/video{source}").exists():
            return cv2.VideoCapture()  # OpenCV would try, and complain on its own
        try:
            if source.isdigit():
                capture = cv2.VideoCapture(int(source), cv2.CAP_ANY)
                capture.set(cv2.CAP_PROP_FRAME_WIDTH, self._settings.camera_width_px)
                capture.set(cv2.CAP_PROP_FRAME_HEIGHT, self._settings.camera_height_px)
                capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
                return capture
            timeouts = (cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, cv2.CAP_PROP_READ_TIMEOUT_MSEC)
            return cv2.VideoCapture(
                source, cv2.CAP_FFMPEG, [value for name in timeouts for value in (name, _NETWORK_TIMEOUT_MS)]
            )
        except cv2.error as error:
            logger.debug("camera: %s", error)
            return cv2.VideoCapture()

    def _grab_from(self, capture: cv2.VideoCapture) -> None:
        """Until it gives no more."""
        period_ns = round(1e9 / self._settings.camera_rate_hz)
        pause_s = _pause_s(self._settings.camera, capture)
        due_ns = 0
        while not self._stop.wait(pause_s) and capture.grab():
            now_ns = self._clock.now_ns()
            if now_ns < due_ns:
                continue
            whole, picture = capture.retrieve()
            if not whole:
                break
            # In rhythm, so that ten a second of a camera with thirty are ten; a pause begins a new one.
            due_ns = due_ns + period_ns if now_ns < due_ns + period_ns else now_ns + period_ns
            self._take(now_ns - self._delay_ns, np.asarray(picture, np.uint8))
        self._trouble = f"camera {self._settings.camera} gives no more pictures: unplugged, or at its end; trying again"

    def _take(self, t_ns: int, picture: Pixels) -> None:
        self._trouble = ""
        now_s = time.monotonic()
        # A sensor has noise: two equal pictures are one that was handed out twice.
        if self._before is None or not np.array_equal(picture, self._before):
            self._fresh_s, self._before = now_s, picture
        if now_s - self._fresh_s > self._settings.camera_frozen_s or self._stop.is_set():
            return
        small = cv2.resize(picture, self._size, interpolation=cv2.INTER_AREA)
        self._put(t_ns, np.asarray(cv2.cvtColor(small, cv2.COLOR_BGR2RGB), np.uint8))
        self.sent += 1


def _pause_s(source: str, capture: cv2.VideoCapture) -> float:
    """Between two pictures of a file, which would all come at once; cameras keep their own time."""
    if not Path(source).is_file():
        return 0.0
    return 1 / (capture.get(cv2.CAP_PROP_FPS) or _FILE_RATE_HZ)


def _why_not_opened(source: str) -> str:
    device = Path(f"/dev/video{source}" if source.isdigit() else source)
    if source.isdigit() and not device.exists():
        there = ", ".join(sorted(path.name.removeprefix("video") for path in Path("/dev").glob("video*"))) or "none"
        return f"camera {source} is not there: plug it in, or name another ([thymio] camera, --camera); found: {there}"
    return f"camera {source} cannot be opened: is it the right one, does another program hold it, may you read it?"
