"""A run's folder: the weights of chosen robot minutes, the checkpoint at the end, and what was measured.

RUN/minutes/005     weights as they were after five robot minutes; `llrp evaluate` takes each
RUN/checkpoint      all that learning goes on from
RUN/report.json     figures; report.html shows them
"""

import re
import shutil
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from llrp_online import checkpoint
from llrp_online.architecture import Weights

if TYPE_CHECKING:
    from llrp_online.learner import Learner

_MINUTES = "minutes"


class RunFolder:
    """Where a run is kept.

    Args:
        path: the folder; made if it is not there.
        at_minutes: robot minutes to keep the weights of.
    """

    def __init__(self, path: Path, at_minutes: Iterable[int]) -> None:
        self.path = path
        self._at_minutes = frozenset(at_minutes)
        path.mkdir(parents=True, exist_ok=True)
        checkpoint.must_be_free(self.checkpoint)

    @property
    def checkpoint(self) -> Path:
        """Of the end."""
        return self.path / "checkpoint"

    def begin(self) -> None:
        """A new run: the minutes of an earlier one in the same folder are not its own."""
        if (folder := self.path / _MINUTES).is_dir():
            shutil.rmtree(folder)

    def keep_minute(self, minute: int, learner: "Learner") -> None:
        """Keep the weights, if this minute was asked for."""
        if minute in self._at_minutes:
            manifest = {"configuration": learner.configuration.model_dump(mode="json"), "version": 0, "minute": minute}
            weights = dict(learner.trainer.weights())
            checkpoint.save(self.path / _MINUTES / f"{minute:03d}", {"weights": weights}, manifest)

    def minutes(self) -> Iterator[tuple[int, Weights]]:
        """The minutes kept, with their weights."""
        folder = self.path / _MINUTES
        for path in sorted(folder.iterdir()) if folder.is_dir() else []:
            if re.fullmatch(r"\d+", path.name):
                yield int(path.name), checkpoint.load(path)[0]["weights"]
