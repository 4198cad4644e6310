"""Differences from what is usual, one bar each, with intervals."""

from collections.abc import Mapping

from matplotlib.figure import Figure

from llrp_online.figures.style import CHANCE, LINES, dress, new_figure


def difference_bars(differences: Mapping[str, tuple[float | None, tuple[float, float] | None]], what: str) -> Figure:
    """One line a name: a dot at the difference, a bar over its interval; the smallest below.

    Args:
        differences: name -> (value, interval); what is None is left out.
        what: label of the axis.
    """
    found = [(value, interval, name) for name, (value, interval) in differences.items() if value is not None]
    figure = new_figure(5.6, 0.6 + 0.24 * max(len(found), 1))
    axes = figure.add_subplot()
    axes.axvline(0.0, color=CHANCE, linewidth=0.8)
    for row, (value, interval, _) in enumerate(sorted(found, key=lambda one: one[0])):
        if interval is not None:
            axes.plot(interval, (row, row), color=LINES[1][0], linewidth=1.4)
        axes.plot(value, row, color=LINES[0][0], marker="o", markersize=4)
    axes.set_yticks(range(len(found)), [name for _, _, name in sorted(found, key=lambda one: one[0])])
    dress(axes, what, "")
    return figure
