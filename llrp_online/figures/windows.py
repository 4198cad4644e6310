"""What each window of the label rule gives: labels a frame on one axis, how far they are right on the other."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from llrp_online.figures.style import CHANCE, LINES, SMALL_PT, TEXT_PT, dress, new_figure

_YIELD, _SHARE = LINES[1], LINES[2]
_PANEL_IN = (3.4, 2.5)
_ACROSS = 3


@dataclass(frozen=True)
class WindowPanel:
    """One panel.

    Attributes:
        title: above it.
        names: of the W fixed windows, ascending.
        per_frame: (W,) known labels a frame.
        share: (W,) of labels; None: undefined.
        drift: both of the drift window.
        recommended: index among the names; None: cannot be told.
    """

    title: str
    names: Sequence[str]
    per_frame: Sequence[float]
    share: Sequence[float | None]
    drift: tuple[float, float | None]
    recommended: int | None


def windows(panels: Sequence[WindowPanel], share_name: str) -> Figure:
    """Two curves a panel over the fixed windows, evenly spaced; the drift window's marks stand to the right of them.

    >>> panel = WindowPanel("r", ["1 s", "2 s"], [3.0, 4.0], [0.99, None], (4.0, 0.98), 1)
    >>> len(windows([panel], "agreeing").axes)
    2
    """
    across = min(_ACROSS, len(panels))
    down = -(-len(panels) // across)
    figure = new_figure(max(_PANEL_IN[0] * across, 5.0), _PANEL_IN[1] * down + 0.5)
    top = 1.1 * max(max(*panel.per_frame, panel.drift[0]) for panel in panels)
    shares = [100 * value for panel in panels for value in (*panel.share, panel.drift[1]) if value is not None]
    low, high = (min(shares), max(shares)) if shares else (0.0, 1.0)
    room = 0.08 * (high - low) or 1.0
    for number, panel in enumerate(panels):
        left = figure.add_subplot(down, across, number + 1)
        right = left.twinx()
        _draw(left, right, panel, share_name)
        left.set_ylim(0, top or 1)
        right.set_ylim(max(low - room, 0.0), min(high + room, 100.0))
    handles = [*figure.axes[0].get_lines()[:1], *figure.axes[1].get_lines()[:1]]
    figure.legend(handles=handles, loc="outside lower center", ncols=2, fontsize=TEXT_PT, frameon=False)
    return figure


def _draw(left: Axes, right: Axes, panel: WindowPanel, share_name: str) -> None:
    steps, aside = np.arange(len(panel.names)), len(panel.names) + 0.5
    share = np.array([np.nan if value is None else 100 * value for value in panel.share], np.float64)
    drift_share = np.nan if panel.drift[1] is None else 100 * panel.drift[1]
    for axes, values, drift, (colour, marker, dash), name in (
        (left, np.asarray(panel.per_frame), panel.drift[0], _YIELD, "known labels a frame"),
        (right, share, drift_share, _SHARE, share_name),
    ):
        axes.plot(steps, values, color=colour, marker=marker, linestyle=dash, markersize=4, linewidth=1.4, label=name)
        axes.plot([aside], [drift], color=colour, marker=marker, markersize=7, markerfacecolor="white")
        axes.axhline(drift, color=colour, linestyle=(0, (1, 3)), linewidth=0.8)
    if panel.recommended is not None:
        left.axvspan(panel.recommended - 0.3, panel.recommended + 0.3, color="0.88", linewidth=0, zorder=0)
    left.axvline(len(panel.names) - 0.25, color=CHANCE, linewidth=0.6)
    dress(left, "window", "known labels a frame")
    right.set_ylabel(f"{share_name} [%]", fontsize=TEXT_PT)
    right.tick_params(labelsize=SMALL_PT, length=2.5)
    right.spines[["top"]].set_visible(False)
    ticks = [name.removesuffix(" s").replace("unlimited", "∞") for name in panel.names]
    left.set_xticks(np.append(steps, aside), [*ticks, "drift"], fontsize=SMALL_PT)
    left.set_xlabel("window [s]", fontsize=TEXT_PT)
    left.set_title(panel.title, fontsize=TEXT_PT)
