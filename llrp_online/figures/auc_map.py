"""The AUC of every target and sensor, written into a map (the paper's figure 'auc_map')."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from llrp_online.figures.layout import Layout, legend_of_names
from llrp_online.figures.style import QUANTITY, SMALL_PT, TEXT_PT, new_figure
from llrp_online.metrics import Score

#: The paper's fixed bounds: a classifier that guesses, and an ideal one.
_CHANCE, _IDEAL = 0.5, 1.0
_AUC = Normalize(_CHANCE, _IDEAL)
_GRID_CELL_IN, _ROW_IN, _COLUMN_IN = 0.29, 0.19, 0.55


def auc_map(score: Score) -> Figure:
    """One cell a target and sensor, or a map a sensor where the targets are a grid; blank where one class is known."""
    layout = Layout(score.targets, score.sensors)
    panels = layout.panels
    if (grid := layout.grid) is None:
        width_in = max(3.0, _COLUMN_IN * len(score.sensors) + 1.5)
        height_in = max(2.8, _ROW_IN * len(score.targets) + 1.2)
    else:
        width_in = _GRID_CELL_IN * len(grid[1]) + 1.3
        height_in = panels * (_GRID_CELL_IN * len(grid[0]) + 0.3) + 0.9
    figure = new_figure(width_in, height_in)
    axes = [figure.add_subplot(panels, 1, panel + 1) for panel in range(panels)]
    image = layout.draw(axes, score.auc, QUANTITY, _AUC)
    if grid is None:
        for target, sensor in np.ndindex(*score.auc.shape):
            _write(axes[0], sensor, target, float(score.auc[target, sensor]))
    else:
        for sensor, one in enumerate(axes):
            one.set_title(score.sensors[sensor], fontsize=TEXT_PT)
            for target, (x_m, y_m, _) in enumerate(score.targets):
                _write(one, y_m * layout.per_metre, x_m * layout.per_metre, float(score.auc[target, sensor]))
    worse = bool((score.auc < _CHANCE).any())
    bar = figure.colorbar(image, ax=axes, fraction=0.05, aspect=30, pad=0.02, extend="min" if worse else "neither")
    bar.set_label("AUC", fontsize=TEXT_PT)
    bar.ax.tick_params(labelsize=SMALL_PT)
    figure.supxlabel(_notes(score), fontsize=SMALL_PT)
    return figure


def _write(axes: Axes, x: float, y: float, auc: float) -> None:
    """Two digits, as 0.87 reads .87 in a small cell; dark on light and light on dark."""
    if np.isnan(auc):
        return
    text = "1" if auc >= 0.995 else f"{auc:.2f}"[1:]
    red, green, blue, _ = QUANTITY(_AUC(auc))
    light = 0.299 * red + 0.587 * green + 0.114 * blue > 0.5
    axes.text(x, y, text, fontsize=SMALL_PT, ha="center", va="center", color="black" if light else "white")


def _notes(score: Score) -> str:
    n = f"n+ {score.n_pos.sum():,}, n− {score.n_neg.sum():,} known labels"
    pooled = "" if np.isnan(score.pooled_auc) else f"; all together AUC {score.pooled_auc:.2f}"
    blank = "\nhatched: only one class is known" if np.isnan(score.auc).any() else ""
    names = legend_of_names(score.sensors) if Layout(score.targets, score.sensors).grid is None else ""
    return "\n".join(filter(None, (names, n + pooled + blank)))
