"""How many labels are known, and how many of them are positive (the paper's figure 'numbers')."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, StrMethodFormatter
from numpy.typing import NDArray

from llrp_online.figures.layout import Layout
from llrp_online.figures.style import NEGATIVE, POSITIVE, QUANTITY, SMALL_PT, TEXT_PT, dress, new_figure

_SIZE_IN = (6.6, 2.7)


def known_labels(known: NDArray[np.int64], targets: NDArray[np.float64]) -> Figure:
    """Left: known labels, negatives and positives, by distance. Right: which share of them is positive.

    Where the targets are a grid: two maps of the same, the number on a logarithmic scale.

    Args:
        known: (T, 2) int64, negatives and positives of each target, all sensors together.
        targets: (T, 3) float64.
    """
    layout = Layout(targets, ("all sensors",))
    total = known.sum(1)
    figure = new_figure(*(_SIZE_IN if layout.grid is None else (6.6, 3.2)))
    left, right = figure.add_subplot(1, 2, 1), figure.add_subplot(1, 2, 2)
    figure.suptitle(f"n = {total.sum():,} known labels, {known[:, 1].sum():,} of them positive", fontsize=TEXT_PT)
    if layout.grid is not None:
        _maps(figure, left, right, layout, known)
        return figure
    distances_m, which = layout.by_distance()
    negatives, positives = (np.bincount(which, known[:, side], len(distances_m)) for side in (0, 1))
    at = distances_m * layout.per_metre
    width = 0.8 * float(np.diff(at).min()) if len(at) > 1 else 0.8
    left.bar(at, positives, width, color=POSITIVE, edgecolor="black", linewidth=0.4, label="positive")
    left.bar(at, negatives, width, positives, color=NEGATIVE, edgecolor="black", linewidth=0.4, label="negative")
    left.yaxis.set_major_formatter(StrMethodFormatter("{x:,.0f}"))
    left.yaxis.set_major_locator(MaxNLocator(nbins=6, integer=True))
    dress(left, layout.distance_label, "known labels")
    right.plot(at, 100 * _share(positives, negatives), color=POSITIVE, marker="o", markersize=3.5, linewidth=1.3)
    right.set_ylim(bottom=0)
    dress(right, layout.distance_label, "share of positives [%]")
    right.grid(axis="y", color="0.9", linewidth=0.6)
    figure.legend(loc="outside lower left", ncols=2, fontsize=TEXT_PT, frameon=False)
    return figure


def _maps(figure: Figure, left: Axes, right: Axes, layout: Layout, known: NDArray[np.int64]) -> None:
    total = known.sum(1)
    share = 100 * _share(known[:, 1], known[:, 0])
    most = max(int(total.max()), 2)
    for axes, values, norm, name in (
        (left, np.ma.masked_equal(total, 0), LogNorm(1, most), "known labels"),
        (right, share, Normalize(0, 100), "share of positives [%]"),
    ):
        image = layout.draw([axes], values[:, None], QUANTITY, norm)
        bar = figure.colorbar(image, ax=axes, fraction=0.045, format=StrMethodFormatter("{x:,.0f}"))
        bar.set_label(name, fontsize=TEXT_PT)
        bar.ax.tick_params(labelsize=SMALL_PT)
    figure.supxlabel(
        "seen from above, forward is up; the box with the nose is the robot; hatched: none known", fontsize=SMALL_PT
    )


def _share(positives: NDArray[np.integer[Any]], negatives: NDArray[np.integer[Any]]) -> NDArray[np.float64]:
    """NaN where none is known."""
    total = positives + negatives
    return np.divide(positives, total, out=np.full(len(total), np.nan), where=total > 0)
