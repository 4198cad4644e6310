"""The Pioneer's results as maps: each cell here, and the same cell in the paper."""

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from llrp_online.figures.layout import Layout
from llrp_online.figures.style import QUANTITY, SMALL_PT, TEXT_PT, new_figure

Floats = NDArray[np.float64]
_CELL_PT = 5.0
#: The paper's fixed bounds: a classifier that guesses, and an ideal one.
_AUC = Normalize(0.5, 1.0)
_SEEN = "seen from above, forward is up; the box with the nose is the robot; hatched: "


def auc_maps(ours: Floats, theirs: Floats, targets: Floats, names: Sequence[str]) -> Figure:
    """AUC in hundredths, (T,) each, here and in the paper; blank where it is undefined."""
    note = f"{_SEEN}one class is known, or none"
    return _beside((ours, theirs), targets, names, _AUC, "AUC", lambda auc: f"{100 * auc:.0f}", note)


def label_maps(ours: NDArray[np.int64], theirs: NDArray[np.int64], targets: Floats, names: Sequence[str]) -> Figure:
    """Known labels, (T,) each, on a logarithmic scale, here and in the paper."""
    known = [np.where(values > 0, values, np.nan).astype(np.float64) for values in (ours, theirs)]
    norm = LogNorm(1, float(max(ours.max(), theirs.max(), 2)))
    return _beside(known, targets, names, norm, "known labels", in_thousands, f"{_SEEN}no label is known")


def in_thousands(count: float) -> str:
    """As it fits a small cell.

    >>> in_thousands(649), in_thousands(1262), in_thousands(83099)
    ('649', '1.3k', '83k')
    """
    if count < 1000:
        return f"{count:.0f}"
    return f"{count / 1000:.1f}k" if count < 9950 else f"{count / 1000:.0f}k"


def _beside(
    maps: Sequence[Floats],
    targets: Floats,
    names: Sequence[str],
    norm: Normalize,
    what: str,
    text: Callable[[float], str],
    note: str,
) -> Figure:
    figure = new_figure(9.6, 4.9)
    panels = [figure.add_subplot(1, len(maps), panel + 1) for panel in range(len(maps))]
    for axes, values, name in zip(panels, maps, names, strict=True):
        image = Layout(targets, (name,)).draw([axes], values[:, None], QUANTITY, norm)
        axes.set_title(name, fontsize=TEXT_PT)
        for (x_m, y_m, _), value in zip(targets, values, strict=True):
            if not np.isnan(value):
                _write(axes, y_m, x_m, text(float(value)), float(norm(value)))
    bar = figure.colorbar(image, ax=panels, fraction=0.03, pad=0.01)  # pyright: ignore[reportPossiblyUnboundVariable]
    bar.set_label(what, fontsize=TEXT_PT)
    bar.ax.tick_params(labelsize=SMALL_PT)
    figure.supxlabel(note, fontsize=SMALL_PT)
    return figure


def _write(axes: Axes, x: float, y: float, text: str, share: float) -> None:
    """Dark on light and light on dark."""
    red, green, blue, _ = QUANTITY(share)
    light = 0.299 * red + 0.587 * green + 0.114 * blue > 0.5
    axes.text(x, y, text, fontsize=_CELL_PT, ha="center", va="center", color="black" if light else "white")
