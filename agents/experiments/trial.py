"""A trial: one pure function of plain values, and where its result is kept."""

import importlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from agents.experiments.shared import code, digest
from llrp_online.files import replace

#: What a trial gives: plain JSON values, the same bytes for the same parameters.
Result = dict[str, Any]


@dataclass(frozen=True)
class Done:
    """A trial that was run.

    Attributes:
        result: the same whenever and wherever it is run.
        computing_s: processor time it took, of all its threads; with the drives it had to make.
    """

    result: Result
    computing_s: float


@dataclass(frozen=True)
class Trial:
    """One run of a study.

    Attributes:
        work: `module:function`; the function takes the cache folder of shared drives (`Path`) and the parameters.
        parameters: plain JSON values; all that the result depends on, the seed among them.

    >>> Trial("agents.experiments.scratch:learn", {"seed": 0}).name
    'learn-81c0036e3faa'
    """

    work: str
    parameters: Mapping[str, Any]

    @property
    def name(self) -> str:
        """What its result is kept under: the function's name and a digest of all that decides the result."""
        return f"{self.work.partition(':')[2]}-{digest(self.work, self.parameters)}"

    def run(self, drives: Path) -> Result:
        """Do the work, here and now."""
        module, _, function = self.work.partition(":")
        return getattr(importlib.import_module(module), function)(drives, **self.parameters)


class Shelf:
    """Results on disk: one file a trial, whole or not there.

    Args:
        folder: made if it is not there.
    """

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder

    def get(self, trial: Trial) -> Result | None:
        """The result kept, or None. A file that is not a result of this trial counts as none: it is run again."""
        try:
            kept = json.loads(self._file(trial).read_text(encoding="utf-8"))
        except (FileNotFoundError, ValueError):
            return None
        same = isinstance(kept, dict) and kept.get("parameters") == _plain(trial.parameters)
        return kept["result"] if same and {"result", "computing_s"} <= kept.keys() else None

    def put(self, trial: Trial, done: Done) -> None:
        """Keep a result, beside the parameters that it is of."""
        told = {"work": trial.work, "parameters": trial.parameters, "code": code(), **asdict(done)}
        replace(self._file(trial), json.dumps(told, indent=1, allow_nan=False))

    def computing_s(self, trials: Sequence[Trial]) -> float:
        """Processor time that trials took, all of which are kept."""
        return sum(json.loads(self._file(trial).read_text(encoding="utf-8"))["computing_s"] for trial in trials)

    def of_other_code(self, trials: Sequence[Trial]) -> int:
        """How many of these trials, all of which are kept, were run by other code than is here now."""
        kept = (json.loads(self._file(trial).read_text(encoding="utf-8")) for trial in trials)
        return sum(told.get("code") != code() for told in kept)

    def _file(self, trial: Trial) -> Path:
        return self._folder / f"{trial.name}.json"


def _plain(values: Mapping[str, Any]) -> Any:
    return json.loads(json.dumps(values))
