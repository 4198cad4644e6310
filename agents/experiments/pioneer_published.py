"""What the paper printed of its Pioneer experiment: the AUC and the number of known labels of every cell."""

import json
from dataclasses import dataclass
from functools import cache
from importlib import resources

import numpy as np
from numpy.typing import NDArray

_FILE = "pioneer_published.json"


@dataclass(frozen=True, eq=False)
class Published:
    """The figure's two maps, in the order of the configuration's targets: x outer, y inner, both ascending.

    Attributes:
        auc: (289,) float64, to two places as printed; NaN where the paper knows no label.
        known_labels: (289,) int64, in 70 minutes.
        source: where they were read.
    """

    auc: NDArray[np.float64]
    known_labels: NDArray[np.int64]
    source: str

    def cells(self, fewest: int) -> NDArray[np.bool_]:
        """(289,) where the paper has at least so many known labels.

        >>> published().cells(1000).sum().item(), published().cells(5000).sum().item()
        (102, 29)
        """
        return self.known_labels >= fewest


@cache
def published() -> Published:
    """As the package has them; the file says how they were read."""
    told = json.loads(resources.files("agents.experiments").joinpath(_FILE).read_text(encoding="utf-8"))
    percent, known = (_as_targets(told[name]) for name in ("auc_percent", "known_labels"))
    return Published(np.where(known > 0, percent / 100, np.nan), known, told["source"])


def _as_targets(rows: list[list[int]]) -> NDArray[np.int64]:
    """The picture's top left is far ahead and to the left: both axes fall there."""
    return np.array(rows, np.int64)[::-1, ::-1].ravel()
