"""The AUC that each window's labels lead to, one panel an odometry and behaviour."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from agents.experiments.statistics import median
from llrp_online.figures.style import LINES, SMALL_PT, TEXT_PT, dress, new_figure

#: A panel is as wide as its ticks need, no less than this, and as many stand side by side as a page is wide.
_PANEL_IN, _TICK_IN, _PAGE_IN = (3.1, 2.4), 0.42, 9.4


def auc_by_window(panels: Mapping[str, Mapping[str, Sequence[float]]], marked: Mapping[str, str]) -> Figure:
    """Median and interval by window; a thin line a run, so that pairs can be seen.

    Args:
        panels: title -> window -> AUC of each run, NaN where undefined.
        marked: title -> window to mark, if it is among them.
    """
    width_in = max(_PANEL_IN[0], _TICK_IN * max(map(len, panels.values())))
    across = min(int(_PAGE_IN / width_in), len(panels))
    down = -(-len(panels) // across)
    figure = new_figure(max(width_in * across, 4.0), _PANEL_IN[1] * down)
    colour, marker, _ = LINES[0]
    axes = None
    for number, (title, found) in enumerate(panels.items()):
        axes = figure.add_subplot(down, across, number + 1, sharey=axes)
        names, runs = list(found), np.array(list(found.values()), np.float64).reshape(len(found), -1)
        axes.plot(range(len(names)), runs, color="0.75", linewidth=0.7)
        for place, values in enumerate(runs):
            if len(known := values[~np.isnan(values)]):
                middle, (low, high) = median(known)
                axes.plot([place, place], [low, high], color=colour, linewidth=1.4)
                axes.plot(place, middle, color=colour, marker=marker, markersize=5)
        if marked.get(title) in names:
            place = names.index(marked[title])
            axes.axvspan(place - 0.3, place + 0.3, color="0.88", linewidth=0, zorder=0)
        ticks = [_short(name) for name in names]
        axes.set_title(title, fontsize=TEXT_PT)
        dress(axes, "window [s]", "mean AUC, 0 to 25 cm")
        axes.set_xticks(range(len(names)), ticks, fontsize=SMALL_PT)
        axes.set_xlim(-0.5, len(names) - 0.5)
    return figure


def _short(window: str) -> str:
    """As it fits under an axis in seconds.

    >>> _short("30 s"), _short("unlimited"), _short("drift, no covariance")
    ('30', '∞', 'drift\\nno cov.')
    """
    return window.removesuffix(" s").replace("unlimited", "∞").replace(", no covariance", "\nno cov.")
