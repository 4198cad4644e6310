"""Pictures: their shape, and whether there is anything in them."""

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from agents.checks.finding import Finding
from agents.intake import shape_fault

_DARK, _BRIGHT = 8.0, 247.0  # mean of all values, 0 to 255
_FLAT_SHARE = 0.5
_FROZEN_SHARE = 0.3


class Pictures:
    """One camera's pictures at the network's size, running.

    >>> pictures = Pictures("camera", (2, 2))
    >>> for _ in range(4):
    ...     pictures.add(np.zeros((2, 2, 3), np.uint8))
    >>> [finding.seen for finding in pictures.findings(Counter({(2, 2): 4}))]
    ['4 of 4 pictures are black', '3 of 4 pictures repeat the one before exactly']
    """

    def __init__(self, topic: str, wanted: tuple[int, int]) -> None:
        self._topic = topic
        self._wanted = wanted
        self._count = self._dark = self._bright = self._repeated = 0
        self._last: NDArray[np.uint8] | None = None

    def add(self, pixels: NDArray[np.uint8]) -> None:
        """Take a picture, (height, width, 3) uint8."""
        mean = float(pixels.mean())
        self._count += 1
        self._dark += mean < _DARK
        self._bright += mean > _BRIGHT
        self._repeated += self._last is not None and np.array_equal(pixels, self._last)
        self._last = pixels

    def findings(self, sizes: Counter[tuple[int, int]]) -> list[Finding]:
        """What is wrong; `sizes` are how often pictures of which (width, height) came."""
        return [*self._shape(sizes), *self._content()]

    def _shape(self, sizes: Counter[tuple[int, int]]) -> list[Finding]:
        found: list[Finding] = []
        for size, count in sizes.most_common(1):
            if fault := shape_fault(size, self._wanted):
                seen, _, mend = fault.partition(": ")
                cause = "a camera mounted on its side, or width and height exchanged"
                found.append(Finding("error", self._topic, f"{count} times {seen}", cause, mend))
            if size[0] < self._wanted[0] or size[1] < self._wanted[1]:
                wanted = f"{self._wanted[0]}x{self._wanted[1]}"
                seen = f"pictures of {size[0]}x{size[1]} are smaller than the network's {wanted}"
                mend = "set the camera to a larger size, or the configuration to a smaller one"
                found.append(Finding("warning", self._topic, seen, "a camera set to a small size", mend))
        if len(sizes) > 1:
            seen = "pictures of several sizes: " + ", ".join(f"{w}x{h} ({n})" for (w, h), n in sizes.most_common(4))
            mend = "keep the camera's settings while it records, and give each camera a topic"
            found.append(Finding("warning", self._topic, seen, "a camera changed, or two in one topic", mend))
        return found

    def _content(self) -> list[Finding]:
        found: list[Finding] = []
        for count, what, cause, mend in (
            (self._dark, "black", "a lens cap, no light, or exposure not set", "look at a picture; switch on exposure"),
            (
                self._bright,
                "white",
                "exposure not set, or light into the lens",
                "look at a picture; switch on exposure",
            ),
        ):
            if count > _FLAT_SHARE * self._count:
                seen = f"{count} of {self._count} pictures are {what}"
                found.append(Finding("error", self._topic, seen, cause, mend))
        if self._repeated > _FROZEN_SHARE * self._count:
            seen = f"{self._repeated} of {self._count} pictures repeat the one before exactly"
            mend = "start the camera again; let its driver send each picture once"
            found.append(Finding("error", self._topic, seen, "a frozen camera or a driver that repeats itself", mend))
        return found
