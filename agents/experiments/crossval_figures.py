"""The figures of the cross-validation that the paper draws by scenario."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from llrp_online.figures.style import LINES, TEXT_PT, dress, new_figure
from llrp_online.metrics import Score
from llrp_online.scoring import mean_auc


def auc_by_scenario(scores: Mapping[str, Score], farthest_m: float) -> Figure:
    """One column a scenario left out, one mark a sensor: its mean AUC up to a distance.

    Args:
        scores: scenario -> score of the network that never saw it.
        farthest_m: targets no farther than this count.
    """
    figure = new_figure(5.6, 3.0)
    axes = figure.add_subplot()
    sensors = next(iter(scores.values())).sensors
    columns = np.arange(len(scores))
    for number, sensor in enumerate(sensors):
        colour, marker, _ = LINES[number % len(LINES)]
        means = [mean_auc(score, farthest_m, sensors=[number])[0] for score in scores.values()]
        offset = 0.12 * (number - (len(sensors) - 1) / 2)
        axes.plot(columns + offset, means, color=colour, marker=marker, markersize=4, linestyle="", label=sensor)
    axes.set_xticks(columns, list(scores), rotation=30, ha="right")
    dress(axes, "", f"mean AUC, 0 to {100 * farthest_m:g} cm")
    axes.legend(fontsize=TEXT_PT, frameon=False, ncols=len(sensors), loc="upper center", bbox_to_anchor=(0.5, 1.16))
    return figure
