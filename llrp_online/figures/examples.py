"""What the robot saw, beside what it predicted and what it found out later (the paper's figure of ten instances)."""

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from llrp_online.figures.layout import Layout, legend_of_names
from llrp_online.figures.style import (
    LABELS,
    NEGATIVE,
    POSITIVE,
    PREDICTION,
    SMALL_PT,
    TEXT_PT,
    UNKNOWN,
    UNKNOWN_HATCH,
)

_PROBABILITY = Normalize(0, 1)
_NAMES_PT = 6.0
_TAG = {"facecolor": "white", "edgecolor": "none", "pad": 1.5}
_CAPTION_LINES, _CHARACTERS_AN_INCH = 2, 19


@dataclass(frozen=True)
class _Sheet:
    """Where all lies on the sheet, in inches: a table of examples, each two columns of maps above a picture."""

    rows: int
    columns: int
    panels: int
    width: float
    map_height: float
    under_map: float
    picture_height: float
    caption: float

    left = 0.45
    right = 0.7
    bottom = 0.42
    gap = 0.12
    between = 0.08

    @property
    def size(self) -> tuple[float, float]:
        """Width and height."""
        return self.left + self.columns * (self.width + self.gap) + self.right, self.bottom + self.rows * self.height

    @property
    def height(self) -> float:
        """Of one example."""
        return (
            self.caption
            + self.panels * (self.map_height + self.between)
            + self.under_map
            + self.picture_height
            + self.gap
        )

    def corner(self, number: int) -> tuple[float, float]:
        """Lower left corner of an example."""
        row, column = divmod(number, self.columns)
        return self.left + column * (self.width + self.gap), self.bottom + (self.rows - 1 - row) * self.height

    def axes(self, figure: Figure, x: float, y: float, width: float, height: float) -> Axes:
        """Axes at a place."""
        full_width, full_height = self.size
        return figure.add_axes((x / full_width, y / full_height, width / full_width, height / full_height))


def examples(
    pictures: Sequence[NDArray[np.uint8]],
    labels: Sequence[NDArray[np.int8]],
    probabilities: Sequence[NDArray[np.float32]],
    captions: Sequence[str],
    targets: NDArray[np.float64],
    sensors: Sequence[str],
) -> Figure:
    """Frames, each below its heat map of predictions (red, left) and its labels (blue, right, unknown hatched).

    Args:
        pictures: N of (H, W, 3 x cameras) uint8; the cameras are put side by side.
        labels: N of (T, S) int8: 1, 0, -1 unknown.
        probabilities: N of (T, S) float32.
        captions: N, cut to two lines.
        targets: (T, 3) float64.
        sensors: S names.
    """
    if not pictures:
        raise ValueError("examples: expected at least one, got none")
    layout = Layout(targets, sensors)
    sheet = _sheet(layout, captions, pictures[0].shape)
    figure = Figure(figsize=sheet.size, facecolor="white")
    for number in range(len(pictures)):
        x, y = sheet.corner(number)
        maps = _maps(figure, sheet, layout, x, y)
        layout.draw(
            maps[0],
            probabilities[number],
            PREDICTION,
            _PROBABILITY,
            ticks=number % sheet.columns == 0,
            most_rows_named=7,
            names_pt=_NAMES_PT,
        )
        layout.draw(
            maps[1],
            np.ma.masked_less(labels[number], 0),
            LABELS,
            _PROBABILITY,
            ticks=False,
            most_rows_named=7,
            names_pt=_NAMES_PT,
        )
        maps[0][0].set_title(
            _wrapped(captions[number], sheet.width), fontsize=TEXT_PT, loc="left", pad=3, parse_math=False
        )
        _picture(sheet.axes(figure, x, y + sheet.gap, sheet.width, sheet.picture_height), pictures[number])
        if layout.panels > 1:
            for axes, sensor in zip(maps[1], sensors, strict=True):
                axes.annotate(sensor, (0.03, 0.97), xycoords="axes fraction", va="top", fontsize=SMALL_PT, bbox=_TAG)
    _legend(figure, sheet, layout)
    return figure


def _sheet(layout: Layout, captions: Sequence[str], picture_shape: tuple[int, ...]) -> _Sheet:
    """Five examples a row, as in the paper; two where each takes the room of a map from above."""
    height, width, channels = picture_shape
    grid = layout.grid
    columns = min(len(captions), 5 if grid is None else 2)
    across = 1.4 if grid is None else 3.2
    if grid is None:
        map_height, under_map = min(max(1.0, 0.045 * len(layout.targets)), 5.0), 0.2
    else:
        map_height, under_map = (across - _Sheet.between) / 2 * len(grid[0]) / len(grid[1]), 0.36
    return _Sheet(
        rows=-(-len(captions) // columns),
        columns=columns,
        panels=layout.panels,
        width=across,
        map_height=map_height,
        under_map=under_map,
        picture_height=across * height / (width * channels // 3),
        caption=0.06 + 0.14 * max(_wrapped(caption, across).count("\n") + 1 for caption in captions),
    )


def _maps(figure: Figure, sheet: _Sheet, layout: Layout, x: float, y: float) -> tuple[list[Axes], list[Axes]]:
    """Axes of the predictions and of the labels, the first sensor's at the top."""
    base = y + sheet.gap + sheet.picture_height + sheet.under_map
    half, step = (sheet.width - sheet.between) / 2, sheet.map_height + sheet.between
    left, right = (
        [
            sheet.axes(figure, at, base + (layout.panels - 1 - panel) * step, half, sheet.map_height)
            for panel in range(layout.panels)
        ]
        for at in (x, x + half + sheet.between)
    )
    return left, right


def _picture(axes: Axes, picture: NDArray[np.uint8]) -> None:
    height, width, channels = picture.shape
    cameras = picture.reshape(height, width, channels // 3, 3)
    axes.imshow(cameras.swapaxes(1, 2).reshape(height, width * channels // 3, 3))
    for camera in range(1, channels // 3):
        axes.axvline(camera * width - 0.5, color="white", linewidth=2)
    axes.set_axis_off()


def _legend(figure: Figure, sheet: _Sheet, layout: Layout) -> None:
    width, height = sheet.size
    bar_height = min(2.2, 0.7 * height)
    bar_axes = sheet.axes(figure, width - sheet.right + 0.05, (height - bar_height) / 2, 0.12, bar_height)
    bar = figure.colorbar(ScalarMappable(_PROBABILITY, PREDICTION), cax=bar_axes)
    bar.set_label("predicted probability", fontsize=TEXT_PT)
    bar.ax.tick_params(labelsize=SMALL_PT)
    from_above = "seen from above, forward is up; the box with the nose is the robot"
    handles = [
        Patch(facecolor=POSITIVE, label="label: the sensor fires"),
        Patch(facecolor=NEGATIVE, label="it does not"),
        Patch(facecolor=UNKNOWN, edgecolor=UNKNOWN_HATCH, hatch="//////", linewidth=0, label="unknown"),
    ]
    figure.legend(
        handles=handles,
        loc="lower center",
        ncols=3 if sheet.columns > 1 else 1,
        fontsize=TEXT_PT,
        frameon=False,
        title=legend_of_names(layout.sensors) if layout.grid is None else from_above,
        title_fontsize=SMALL_PT,
        handlelength=1.2,
    )


def _wrapped(caption: str, width_in: float) -> str:
    columns = round(width_in * _CHARACTERS_AN_INCH)
    return "\n".join(textwrap.wrap(caption, columns, max_lines=_CAPTION_LINES, placeholder=" …"))
