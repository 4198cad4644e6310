"""AUC against robot time and against distance, between chance (0.5) and ideal (1.0), the paper's bounds."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from llrp_online.figures.layout import Layout
from llrp_online.figures.style import CHANCE, LINES, TEXT_PT, dress, new_figure
from llrp_online.metrics import Score


def learning_curve(
    minutes: Sequence[float],
    mean_0_25: Sequence[float | None],
    mean_0_15: Sequence[float | None],
    cells: Sequence[int],
) -> Figure:
    """Mean AUC of the weights after so many robot minutes, for targets up to 25 cm and up to 15 cm; None: undefined.

    `cells` are the targets x sensors that the mean up to 25 cm is of.
    """
    figure = new_figure(4.2, 2.9)
    axes = figure.add_subplot()
    n = _span(cells)
    for values, name, line in (
        (mean_0_25, f"0 to 25 cm (n = {n} targets × sensors)", LINES[0]),
        (mean_0_15, "0 to 15 cm", LINES[1]),
    ):
        colour, marker, dash = line
        numbers = np.array([np.nan if value is None else value for value in values], np.float64)
        axes.plot(
            minutes, numbers, color=colour, marker=marker, linestyle=dash, markersize=4, linewidth=1.4, label=name
        )
    _between_chance_and_ideal(axes)
    dress(axes, "robot time [min]", "mean AUC on held-out frames")
    axes.set_xlim(0, 1.03 * max(minutes) or 1)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, nbins=10))
    _legend_below(figure, 1)
    return figure


def auc_by_distance(score: Score, groups: Mapping[str, Sequence[int]] | None = None) -> Figure:
    """AUC by distance of the target, one line a group of sensors, with 95 % interval bands.

    A line is the mean over the group's cells (target x sensor) that have an AUC, its band the mean of their intervals:
    exact where the cells err together, wider than the interval of the mean where they do not. Both are blank where no
    cell has one.

    Args:
        score: of an evaluation; without intervals no band is drawn.
        groups: name -> sensor indices; left out: centre and lateral sensors if they are named so, else each sensor.
    """
    layout = Layout(score.targets, score.sensors)
    distances_m, which = layout.by_distance()
    figure = new_figure(4.2, 3.1)
    axes = figure.add_subplot()
    at = distances_m * layout.per_metre
    for number, (name, sensors) in enumerate((groups or sensor_groups(score.sensors)).items()):
        colour, marker, dash = LINES[number % len(LINES)]
        auc, low, high = (
            _mean_by(values[:, sensors], which, len(distances_m)) for values in (score.auc, score.low, score.high)
        )
        n = f"n+ {score.n_pos[:, sensors].sum():,}, n− {score.n_neg[:, sensors].sum():,}"
        axes.plot(
            at, auc, color=colour, marker=marker, linestyle=dash, markersize=3.5, linewidth=1.3, label=f"{name} ({n})"
        )
        axes.fill_between(at, low, high, color=colour, alpha=0.18, linewidth=0)
    _between_chance_and_ideal(axes)
    dress(axes, layout.distance_label, "AUC")
    margin = 0.02 * (at[-1] - at[0]) or 0.5
    axes.set_xlim(at[0] - margin, at[-1] + margin)
    _legend_below(figure, 1, None if np.isnan(score.low).all() else "shaded: 95 % intervals")
    return figure


def sensor_groups(sensors: Sequence[str]) -> dict[str, list[int]]:
    """Centre and lateral sensors where the names tell, as the paper groups them; else each sensor alone.

    >>> sensor_groups(["left", "center_left", "center", "right"])
    {'centre sensors': [1, 2], 'lateral sensors': [0, 3]}
    >>> sensor_groups(["floor"])
    {'floor': [0]}
    """
    centre = [i for i, name in enumerate(sensors) if name.startswith(("center", "centre"))]
    lateral = [i for i, name in enumerate(sensors) if name.startswith(("left", "right"))]
    if centre and lateral and len(centre) + len(lateral) == len(sensors):
        return {"centre sensors": centre, "lateral sensors": lateral}
    return {name: [i] for i, name in enumerate(sensors)}


def _mean_by(values: NDArray[np.float64], which: NDArray[np.int64], count: int) -> NDArray[np.float64]:
    """Mean over what is defined at each distance: (T, S) -> (count,), NaN where nothing is."""
    defined = ~np.isnan(values)
    sums = np.bincount(which, np.where(defined, values, 0.0).sum(1), count)
    cells = np.bincount(which, defined.sum(1), count)
    return np.divide(sums, cells, out=np.full(count, np.nan), where=cells > 0)


def _between_chance_and_ideal(axes: Axes) -> None:
    """From chance to 1, or from below chance if something lies there."""
    drawn = [np.asarray(line.get_ydata(), np.float64) for line in axes.lines]
    drawn += [np.asarray(path.vertices)[:, 1] for band in axes.collections for path in band.get_paths()]
    values = np.concatenate([np.array([0.5]), *drawn])
    axes.axhline(0.5, color=CHANCE, linewidth=1.0, linestyle=(0, (1, 2)), label="chance")
    axes.set_ylim(np.floor(np.nanmin(values) * 10) / 10 - 0.02, 1.01)
    axes.grid(axis="y", color="0.9", linewidth=0.6)


def _legend_below(figure: Figure, columns: int, note: str | None = None) -> None:
    """Below the axes, where it can never hide a line."""
    figure.legend(
        loc="outside lower center",
        ncols=columns,
        fontsize=TEXT_PT,
        frameon=False,
        title=note,
        title_fontsize=TEXT_PT,
        handlelength=3,
    )


def _span(numbers: Sequence[int]) -> str:
    low, high = min(numbers), max(numbers)
    return f"{low:,}" if low == high else f"{low:,} to {high:,}"
