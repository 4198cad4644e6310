"""Differences from what is usual as bars with intervals: one each, or two, before and after."""

from collections.abc import Mapping

from matplotlib.figure import Figure

from llrp_online.figures.style import CHANCE, LINES, TEXT_PT, dress, new_figure

#: A value and its interval (low, high).
Estimate = tuple[float, tuple[float, float]]


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


def paired_bars(
    pairs: Mapping[str, tuple[Estimate | None, Estimate | None]], names: tuple[str, str], what: str
) -> Figure:
    """Two bars a row, a dark one above a light hatched one, each with its interval; the first row on top.

    Args:
        pairs: row -> two of (value, interval); what is None is left out.
        names: of the two, in the legend.
        what: label of the axis.
    """
    figure = new_figure(5.6, 0.9 + 0.36 * max(len(pairs), 1))
    axes = figure.add_subplot()
    forms = ((-0.19, LINES[1][0], ""), (0.19, "#ffffff", "////"))
    for index, (offset, colour, hatch) in enumerate(forms):
        found = [(row + offset, pair[index]) for row, pair in enumerate(pairs.values())]
        known = [(row, estimate) for row, estimate in found if estimate is not None]
        rows, widths = [row for row, _ in known], [value for _, (value, _) in known]
        axes.barh(
            rows, widths, 0.34, color=colour, hatch=hatch, edgecolor=LINES[0][0], linewidth=0.7, label=names[index]
        )
        for row, (_, (low, high)) in known:
            axes.plot((low, high), (row, row), color=CHANCE, linewidth=1.6)
    axes.axvline(0.0, color=LINES[0][0], linewidth=0.8)
    axes.set_yticks(range(len(pairs)), list(pairs))
    axes.invert_yaxis()
    dress(axes, what, "")
    axes.legend(fontsize=TEXT_PT, frameon=False, loc="lower right")
    return figure
