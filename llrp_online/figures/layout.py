"""Where targets lie on paper: a line as one row a distance (the farthest at the top), a grid as a map from above.

Any other list of targets is drawn as rows too, one a target, the first at the bottom.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Colormap, Normalize
from matplotlib.image import AxesImage
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from llrp_online.figures.style import SMALL_PT, TEXT_PT, UNKNOWN, UNKNOWN_HATCH

Floats = NDArray[np.float64]

# Poses are computed, so equal ones differ in their last bits; a micrometre tells real ones apart.
_DECIMALS = 6
_ROWS_A_NAME = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 10_000, 1_000_000)


@dataclass(frozen=True, eq=False)
class Layout:
    """How (T, S) values are laid out.

    Args:
        targets: (T, 3) float64 `[x_m, y_m, yaw_rad]`.
        sensors: S names.

    >>> Layout(np.array([[0.0, 0, 0], [0.1, 0, 0]]), ["center_left", "right"]).unit
    'cm'
    """

    targets: Floats
    sensors: Sequence[str]

    @property
    def on_a_line(self) -> bool:
        """All targets straight ahead or behind, looking forward."""
        return bool(np.allclose(self.targets[:, 1:], 0.0, atol=10.0**-_DECIMALS))

    @property
    def grid(self) -> tuple[Floats, Floats] | None:
        """The x [m] and y [m] of a full grid, x outer and y inner; None if the targets are none."""
        x_m, y_m = (np.unique(self.targets[:, axis].round(_DECIMALS)) for axis in (0, 1))
        if min(len(x_m), len(y_m)) < 2 or len(x_m) * len(y_m) != len(self.targets):
            return None
        full = np.stack(np.meshgrid(x_m, y_m, indexing="ij"), -1).reshape(-1, 2)
        return (x_m, y_m) if np.allclose(full, self.targets[:, :2], atol=2 * 10.0**-_DECIMALS) else None

    @property
    def panels(self) -> int:
        """Maps that a (T, S) array takes: a grid needs one a sensor."""
        return 1 if self.grid is None else len(self.sensors)

    @property
    def unit(self) -> str:
        """Distances read best in cm up to a metre, else in m."""
        return "cm" if float(np.abs(self.targets[:, :2]).max()) <= 1.0 else "m"

    @property
    def per_metre(self) -> float:
        """That unit in a metre."""
        return 100.0 if self.unit == "cm" else 1.0

    def by_distance(self) -> tuple[Floats, NDArray[np.int64]]:
        """Distances that targets share [m], near to far, and which of them each target has, (T,).

        On a line: the distance ahead, less than nothing behind. Else from the robot, in rings as wide as the closest
        two distances along x lie apart.
        """
        if self.on_a_line:
            distance_m = self.targets[:, 0].round(_DECIMALS)
        else:
            distance_m = np.hypot(self.targets[:, 0], self.targets[:, 1]).round(_DECIMALS)
            steps_m = np.diff(np.unique(self.targets[:, 0].round(_DECIMALS)))
            if len(steps_m):
                distance_m = (np.round(distance_m / steps_m.min()) * steps_m.min()).round(_DECIMALS)
        distinct, which = np.unique(distance_m, return_inverse=True)
        return distinct, which.astype(np.int64)

    @property
    def distance_label(self) -> str:
        """What an axis of `by_distance` is called."""
        return f"distance of the target{' ahead' if self.on_a_line else ''} [{self.unit}]"

    def draw(
        self,
        axes: Sequence[Axes],
        values: NDArray[Any],
        colours: Colormap,
        norm: Normalize,
        *,
        ticks: bool = True,
        most_rows_named: int = 12,
        names_pt: float = SMALL_PT,
    ) -> AxesImage:
        """Draw (T, S) values on `panels` axes; where they are masked or NaN, the hatched ground shows through."""
        masked = np.ma.masked_invalid(values)
        bare = colours.with_extremes(bad=(0, 0, 0, 0))
        if len(axes) != self.panels:
            raise ValueError(f"axes: expected {self.panels} for these targets and sensors, got {len(axes)}")
        if (grid := self.grid) is None:
            image = axes[0].imshow(masked, bare, norm, origin="lower", aspect="auto", interpolation="nearest")
            self._rows(axes[0], most_rows_named if ticks else 0, names_pt)
        else:
            for sensor, one in enumerate(axes):
                image = self._from_above(one, masked[:, sensor], grid, bare, norm)
                self._name_axes(one, along=ticks, across=ticks and sensor == self.panels - 1)
        for one in axes:
            one.patch.set(facecolor=UNKNOWN, edgecolor=UNKNOWN_HATCH, hatch="//////")
            one.spines[:].set_linewidth(0.5)
        return image  # pyright: ignore[reportPossiblyUnboundVariable] there is a sensor at least

    def _rows(self, axes: Axes, most_named: int, names_pt: float) -> None:
        axes.set_xticks(range(len(self.sensors)), short_names(self.sensors), fontsize=names_pt)
        axes.tick_params(length=0, pad=2)
        if not most_named:
            axes.set_yticks([])
            return
        every = next(step for step in _ROWS_A_NAME if len(self.targets) <= step * most_named)
        rows = range(0, len(self.targets), every)
        if self.on_a_line:
            names = [f"{self.targets[row, 0] * self.per_metre:.3g}" for row in rows]
            axes.set_ylabel(f"distance [{self.unit}]", fontsize=TEXT_PT)
        else:
            poses = self.targets * [self.per_metre, self.per_metre, 180 / np.pi]
            names = [f"{x:.3g}, {y:.3g}, {yaw:.0f}" for x, y, yaw in poses[list(rows)]]
            axes.set_ylabel(f"target: x, y [{self.unit}], yaw [°]", fontsize=TEXT_PT)
        axes.set_yticks(rows, names, fontsize=SMALL_PT)
        axes.tick_params(axis="y", length=2)

    def _from_above(
        self,
        axes: Axes,
        values: NDArray[Any],
        grid: tuple[Floats, Floats],
        colours: Colormap,
        norm: Normalize,
    ) -> AxesImage:
        """Forward is up; y counts to the left, so its axis does too."""
        x, y = (axis * self.per_metre for axis in grid)
        half_x, half_y = ((axis[1] - axis[0]) / 2 for axis in (x, y))
        edges = (y[0] - half_y, y[-1] + half_y, x[0] - half_x, x[-1] + half_x)
        cells = values.reshape(len(x), len(y))
        image = axes.imshow(cells, colours, norm, origin="lower", extent=edges, interpolation="nearest")
        axes.invert_xaxis()
        # The robot as an open box with a nose, so that the value of its own cell can still be read.
        for colour, width in (("white", 3.0), ("black", 1.4)):
            box = Rectangle((-half_y, -half_x), 2 * half_y, 2 * half_x, fill=False, edgecolor=colour, linewidth=width)
            axes.add_patch(box)
        axes.plot([0], [half_x], "^", markersize=5, color="black", markeredgecolor="white", markeredgewidth=0.6)
        return image

    def _name_axes(self, axes: Axes, *, along: bool, across: bool) -> None:
        """Of a map from above: forward, and to the left."""
        axes.tick_params(labelsize=SMALL_PT, length=2)
        if along:
            axes.set_ylabel(f"x, forward [{self.unit}]", fontsize=TEXT_PT)
        else:
            axes.set_yticks([])
        if across:
            axes.set_xlabel(f"y, to the left [{self.unit}]", fontsize=TEXT_PT)
        else:
            axes.set_xticks([])


def short_names(sensors: Sequence[str]) -> list[str]:
    """Initials if they tell the sensors apart, else the names.

    >>> short_names(["left", "center_left", "right"]), short_names(["rear", "right"])
    (['L', 'CL', 'R'], ['rear', 'right'])
    """
    initials = ["".join(word[0].upper() for word in name.replace("-", "_").split("_") if word) for name in sensors]
    return initials if len(sensors) > 1 and len(set(initials)) == len(sensors) and all(initials) else list(sensors)


def legend_of_names(sensors: Sequence[str]) -> str:
    """What the short names stand for; empty if they are the names."""
    short = short_names(sensors)
    if short == list(sensors):
        return ""
    return "columns: " + ", ".join(f"{s} {name.replace('_', ' ')}" for s, name in zip(short, sensors, strict=True))
