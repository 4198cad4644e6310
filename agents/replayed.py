"""The online learner over recordings, in virtual time: event by event, each step when the sensors' clock says so."""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from agents.intake import Intake
from agents.offline import messages_of, report_drops
from agents.progress import track_recordings
from llrp_online.learner import Learner
from llrp_online.status import HAIR_S


class Marks:
    """Tells when a learner has lived so long: give it to `learn_over`.

    Args:
        learner: whose life it is.
        at_s: robot seconds lived, ascending; may have no end.
        reached: called with each, once.
    """

    def __init__(self, learner: Learner, at_s: Iterable[float], reached: Callable[[float], None]) -> None:
        self._learner, self._later, self._reached = learner, iter(at_s), reached
        self._next = next(self._later, math.inf)

    def __call__(self) -> None:
        """Look."""
        while self._learner.pace.lived_s >= self._next - HAIR_S:
            self._reached(self._next)
            self._next = next(self._later, math.inf)


def learn_over(learner: Learner, recordings: Sequence[Path], watch: Callable[[], None] = lambda: None) -> None:
    """Let `learner` live through recordings, in order; deterministic.

    Args:
        learner: is changed.
        recordings: one trajectory each.
        watch: called after each message.
    """
    drops: Counter[str] = Counter()
    for path, told in track_recordings(recordings, "learning"):
        intake = Intake(learner.configuration)
        for message, share in messages_of(path, intake):
            for event in intake.events(message.topic, message.type, message.data, message.log_ns):
                learner.take(event)
                while learner.due():
                    learner.step()
            watch()
            told(share)
        learner.end_recording()
        drops.update(intake.drops)
    report_drops("all recordings", drops + learner.labeller.drops)
