"""What the window study found for one behaviour with one odometry, run by run."""

import math
from dataclasses import dataclass

import numpy as np

from agents.experiments.labelling import BLIND_DRIFT
from agents.experiments.trial import Result
from llrp_online.windows import DRIFT, recommended

#: Windows that drift closes, not the clock.
DRIFTING = (DRIFT, BLIND_DRIFT)


@dataclass(frozen=True)
class Runs:
    """One value a run.

    Attributes:
        labelled: what `labelling.label` gave.
        auc: window -> mean AUC to 25 cm, NaN where undefined.
    """

    labelled: list[Result]
    auc: dict[str, list[float]]

    @property
    def fixed(self) -> list[str]:
        """Names of the fixed windows that were labelled by, ascending."""
        return [name for name in self.labelled[0]["windows"] if name not in DRIFTING]

    def middle(self, window: str, what: str) -> float | None:
        """The median over runs; None if it is undefined in each."""
        known = [run["windows"][window][what] for run in self.labelled]
        known = [value for value in known if value is not None]
        return float(np.median(known)) if known else None

    def best_learned(self, without: int | None = None) -> str | None:
        """The fixed window whose learners are best on average, of all runs or of all but one; None where none is."""
        means: dict[str, float] = {}
        for name, auc in self.auc.items():
            known = [value for run, value in enumerate(auc) if run != without and not math.isnan(value)]
            if known and name not in DRIFTING:
                means[name] = sum(known) / len(known)
        return max(means, key=lambda name: means[name]) if means else None

    def gains(self, drift: str, *, hindsight: bool) -> list[float]:
        """AUC of a drift window less that of the best fixed one, a run each, NaN where undefined.

        With hindsight one fixed window is the best of all runs; without, each run is held against the others' best.
        """
        gained: list[float] = []
        for run, value in enumerate(self.auc.get(drift, [])):
            best = self.best_learned(None if hindsight else run)
            gained.append(math.nan if best is None else value - self.auc[best][run])
        return gained

    @property
    def best(self) -> str:
        """The fixed window whose labels are worth most, as the truth tells: the recommended one."""
        return recommended({name: self.middle(name, "true_worth") or 0.0 for name in self.fixed})
