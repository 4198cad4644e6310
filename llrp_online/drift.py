"""When the world has changed: the predictions of a band of distances have become worse than they were.

River's ADWIN (Bifet and Gavalda 2007) on the masked log-loss of each band, bounded as ADWIN asks for. A loss that falls
is learning, no drift, and is not reported, though ADWIN forgets the past then too.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from river.drift import ADWIN

# The fewest values that ADWIN takes for a present of its own (its default).
_SHORTEST = 5
#: A frame's loss counts as no more than this [nats]: ADWIN is for values from 0 to 1, and log-losses have no end.
_WORST = 1.0


@dataclass(frozen=True)
class DriftEvent:
    """A band became worse.

    Attributes:
        t_ns: sensor time of the value that told.
        band: index of the band, near to far.
        before: mean log-loss [nats] of the past that no longer holds; no frame's counts as more than 1.
        after: the same of the newest five blocks.
    """

    t_ns: int
    band: int
    before: float
    after: float


class DriftDetector:
    """One ADWIN for each band.

    ADWIN takes its values for independent, and successive frames are not: `block` frames are averaged into one value,
    so that a single obstacle seen ten times does not count as ten proofs. Losses are those of `Prequential.resolved`.

    What it does badly: a slow decline is reported late or never, and a change within the first few dozen blocks too.

    Args:
        bands: how many.
        delta: ADWIN's chance of a false alarm; smaller is calmer.
        block: known frames of a band that make one value.

    >>> detector = DriftDetector(bands=1, block=1)
    >>> losses = [0.2] * 300 + [0.9] * 100
    >>> [(event.t_ns, round(event.before, 1)) for t, loss in enumerate(losses) for event in detector.update(t, [loss])]
    [(315, 0.2)]
    """

    def __init__(self, bands: int, delta: float = 0.002, block: int = 10) -> None:
        if block < 1:
            raise ValueError(f"block: expected at least one frame, got {block}")
        self._windows = [ADWIN(delta=delta, clock=1, min_window_length=_SHORTEST) for _ in range(bands)]
        self._block = block
        self._newest: list[deque[float]] = [deque(maxlen=_SHORTEST) for _ in range(bands)]
        self._waiting: list[list[float]] = [[] for _ in range(bands)]

    def update(self, t_ns: int, band_losses: NDArray[np.float64] | list[float]) -> list[DriftEvent]:
        """Take one frame's loss in each band, NaN where nothing is known; return the bands that became worse."""
        if len(band_losses) != len(self._windows):
            raise ValueError(f"band_losses: expected {len(self._windows)} bands, got {len(band_losses)}")
        events: list[DriftEvent] = []
        for band, loss in enumerate(band_losses):
            waiting = self._waiting[band]
            if np.isnan(loss):
                continue
            waiting.append(min(float(loss), _WORST))
            if len(waiting) == self._block:
                value = sum(waiting) / self._block
                waiting.clear()
                self._newest[band].append(value)
                before = _update(self._windows[band], value)
                # What the window keeps still has some of the past in it, and would hide how bad it is now.
                after = sum(self._newest[band]) / len(self._newest[band])
                if before is not None and after > before:
                    events.append(DriftEvent(t_ns, band, before, after))
        return events


def _update(window: ADWIN, value: float) -> float | None:
    """The mean of the past, if this value made the window drop it; else None."""
    total, width = float(window.total) + value, float(window.width) + 1
    window.update(value)
    if not window.drift_detected:
        return None
    # What was dropped is what the window held, less what it holds.
    return (total - float(window.total)) / (width - float(window.width))
