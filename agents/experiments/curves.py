"""What studies draw alike: the AUC of several runs against robot time, their median and the middle half."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from agents.experiments.trial import Result
from llrp_online.figures.style import LINES, TEXT_PT, dress, new_figure

#: The marks of one run, as `agents.experiments.learning.learn` gives them.
Marks = Sequence[Result]


def values(runs: Sequence[Marks], exam: str, part: str = "far") -> NDArray[np.float64]:
    """(runs, marks), NaN where undefined."""
    read = [[mark[exam][part] for mark in marks] for marks in runs]
    return np.array([[np.nan if value is None else value for value in row] for row in read], np.float64)


def time(seconds: float) -> str:
    """As one reads it.

    >>> time(15), time(600)
    ('15 s', '10 min')
    """
    return f"{seconds:g} s" if seconds < 60 else f"{seconds / 60:g} min"


def _minutes(mark: Result) -> float:
    return mark["lived_s"] / 60


def _metres(mark: Result) -> float:
    return mark["driven_m"]


def _steps(mark: Result) -> float:
    return mark["steps"]


#: What curves go by: label of the axis, and how to read it off a mark.
TIME, METRES, STEPS = ("robot time [min]", _minutes), ("driven, by odometry [m]", _metres), ("training steps", _steps)
Abscissa = tuple[str, Callable[[Result], float]]


def curves(groups: Mapping[str, Sequence[Marks]], exam: str, by: Abscissa = TIME) -> Figure:
    """One line a group of runs; none for a group without any value.

    Where runs differ in what the curve goes by, a mark lies at their median.
    """
    label, read = by
    figure = new_figure(4.8, 3.3)
    axes = figure.add_subplot()
    for number, (name, runs) in enumerate(groups.items()):
        colour, marker, dash = LINES[number % len(LINES)]
        x = np.median([[read(mark) for mark in marks] for marks in runs], axis=0)
        found = values(runs, exam)
        known = ~np.isnan(found).all(0)
        if not known.any():
            continue
        low, middle, high = np.nanpercentile(found[:, known], [25, 50, 75], axis=0)
        axes.fill_between(x[known], low, high, color=colour, alpha=0.15, linewidth=0)
        axes.plot(x[known], middle, color=colour, marker=marker, linestyle=dash, markersize=4, label=name)
    dress(axes, label, "mean AUC, 0 to 25 cm")
    if axes.lines:
        title = "median; the band holds the middle half of the runs"
        axes.legend(fontsize=TEXT_PT, frameon=False, title=title, title_fontsize=TEXT_PT)
    return figure
