"""Where the robot went by its own odometry, and where its sensors fired."""

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from llrp_online.figures.style import QUANTITY, SMALL_PT, TEXT_PT, dress, new_figure

_START, _END = "#009E73", "#D55E00"
_FEW_S = 120.0


def trajectory(
    path: NDArray[np.float64], fired: NDArray[np.float64], path_s: NDArray[np.float64] | None = None
) -> Figure:
    """The path, dark at first and light at last; a dot where a sensor fired; start and end marked; equal axes.

    Args:
        path: (N, 3) float64 poses `[x_m, y_m, yaw_rad]`, N >= 1; a row of NaN breaks the line (a pose jump, another
            recording).
        fired: (M, 2) float64 `[x_m, y_m]` of the robot when a sensor fired.
        path_s: (N,) float64, time of each pose; left out, colour is the share of the run, by poses.
    """
    whole = np.isfinite(path[:, 0]) & np.isfinite(path[:, 1])
    points = path[whole, :2]
    if not len(points):
        raise ValueError(f"path: expected at least one finite pose, got {len(path)} rows")
    figure = new_figure(4.4, 4.0)
    axes = figure.add_subplot()
    pairs = np.stack([path[:-1, :2], path[1:, :2]], 1)
    drawn = whole[:-1] & whole[1:]
    if path_s is None:
        when, name = 100 * np.arange(len(path)) / max(len(path) - 1, 1), "share of the run [%]"
    else:
        when, name = _clock(path_s - path_s[whole][0])
    line = LineCollection(list(pairs[drawn]), cmap=QUANTITY, linewidths=1.6, capstyle="round", label="path")
    line.set_array(when[:-1][drawn])
    line.set_clim(0, when[whole][-1] or 1)
    axes.add_collection(line)
    axes.plot(
        *fired.T,
        color="#CC0000",
        marker="x",
        markersize=4,
        markeredgewidth=0.9,
        linestyle="none",
        zorder=3,
        label=f"a sensor fired (n = {len(fired):,})",
    )
    for point, marker, colour, what in ((points[0], "o", _START, "start"), (points[-1], "s", _END, "end")):
        axes.plot(
            *point[:, None],
            color=colour,
            marker=marker,
            markersize=8,
            markeredgecolor="black",
            markeredgewidth=1,
            linestyle="none",
            zorder=4,
            label=what,
        )
    dress(axes, "x [m]", "y [m]")
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.06)
    bar = figure.colorbar(line, ax=axes, fraction=0.04, aspect=30, pad=0.02)
    bar.set_label(name, fontsize=TEXT_PT)
    bar.ax.tick_params(labelsize=SMALL_PT)
    handles = list(axes.lines)
    figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize=TEXT_PT, frameon=False)
    return figure


def _clock(since_s: NDArray[np.float64]) -> tuple[NDArray[np.float64], str]:
    """Minutes, or seconds if they are few."""
    if np.nanmax(since_s) > _FEW_S:
        return since_s / 60, "time since the start [min]"
    return since_s, "time since the start [s]"
