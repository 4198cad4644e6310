"""Which weights go out: a version that recent held-out frames judge not worse; old ones are kept for roll-back."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from llrp_online.architecture import Weights
from llrp_online.calibration import Calibration
from llrp_online.configuration.learning import Publishing
from replay.batch import Batch

#: Log-loss of weights on a batch, or None where no label is known.
Judge = Callable[[Weights, Batch], float | None]


@dataclass(frozen=True, eq=False)
class Version:
    """Weights that were published.

    Attributes:
        number: counts up from 1.
        t_ns: when, by the clock of `offer` and `publish`.
        weights: name to float32 array.
        held_out_loss: by which they were judged [nats]; None where nothing could judge them.
        calibration: by which their probabilities mean what they say; None: they are as they come.
    """

    number: int
    t_ns: int
    weights: Weights
    held_out_loss: float | None
    calibration: Calibration | None = None

    @property
    def outgoing(self) -> Weights:
        """The weights for all who predict with them: calibrated."""
        return self.weights if self.calibration is None else self.calibration.fold(self.weights)


class Publisher:
    """The gate, and the versions that passed it.

    Args:
        settings: `[publishing]`.
        judge: gives the log-loss of weights on the held-out slice.
    """

    def __init__(self, settings: Publishing, judge: Judge) -> None:
        self._settings = settings
        self._judge = judge
        self._versions: deque[Version] = deque(maxlen=settings.keep)
        self._marked: deque[Version] = deque(maxlen=settings.keep)
        self._start_ns: int | None = None
        self._tried_ns: int | None = None
        self._published = 0
        self.rejected = 0

    @property
    def published(self) -> int:
        """Number of the newest version ever, kept or not; 0 before the first."""
        return self._published

    @property
    def newest(self) -> Version | None:
        """The version that predicts now."""
        return self._versions[-1] if self._versions else None

    @property
    def kept(self) -> list[int]:
        """Numbers of the versions kept, oldest first."""
        return sorted({version.number for version in (*self._marked, *self._versions)})

    def mark(self) -> None:
        """Keep the newest version for longer: as many marked ones as there are others."""
        if self.newest is not None and self.newest not in self._marked:
            self._marked.append(self.newest)

    def due(self, t_ns: int) -> bool:
        """Is it time to try again?"""
        return self._tried_ns is None or t_ns - self._tried_ns >= self._settings.every_s * 1e9

    def offer(
        self, weights: Weights, held_out: Batch | None, t_ns: int, calibration: Calibration | None = None
    ) -> Version | None:
        """Publish `weights` unless the held-out slice finds them worse than the newest; the new version, or None.

        The gate stays open for the first `trust_after_s`: early on every learner gets worse before it gets better.
        Weights that are not finite never pass.
        """
        self._start_ns = t_ns if self._start_ns is None else self._start_ns
        self._tried_ns = t_ns
        if not all(np.isfinite(values).all() for values in weights.values()):
            self.rejected += 1
            return None
        loss = None if held_out is None else self._judge(weights, held_out)
        trusted = t_ns - self._start_ns < self._settings.trust_after_s * 1e9
        if not trusted and self.newest is not None and held_out is not None and loss is not None:
            now = self._judge(self.newest.weights, held_out)
            if now is not None and loss > now * (1 + self._settings.margin):
                self.rejected += 1
                return None
        return self.publish(weights, t_ns, loss, calibration)

    def publish(
        self,
        weights: Weights,
        t_ns: int,
        held_out_loss: float | None = None,
        calibration: Calibration | None = None,
    ) -> Version:
        """Publish without asking."""
        self._published += 1
        self._versions.append(Version(self._published, t_ns, weights, held_out_loss, calibration))
        return self._versions[-1]

    def find(self, number: int) -> Version:
        """A version kept; KeyError says which there are."""
        for version in (*self._marked, *self._versions):
            if version.number == number:
                return version
        raise KeyError(f"version {number} is not kept; kept: {self.kept}")

    def state(self) -> dict[str, int | None]:
        """JSON values for `restore`; the versions themselves stay behind."""
        return {"published": self._published, "start_ns": self._start_ns, "tried_ns": self._tried_ns}

    def restore(self, state: dict[str, Any]) -> None:
        """Go on by the same clock."""
        self.go_on_from(state["published"])
        self._start_ns, self._tried_ns = state["start_ns"], state["tried_ns"]

    def go_on_from(self, number: int) -> None:
        """Count on from a number, after a checkpoint was loaded."""
        self._published = max(self._published, number)
