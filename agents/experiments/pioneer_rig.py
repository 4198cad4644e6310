"""The Pioneer's rig in one picture: a map, the floor that each camera covers, and what they see of it."""

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from agents.robots.pioneer import Eyes, Floor, Pinhole, PioneerWorld
from llrp_online.figures.style import LINES, SMALL_PT, TEXT_PT, dress, new_figure

Floats = NDArray[np.float64]
_EVERY_TEXEL = 8


def rig(world: PioneerWorld, targets: Floats, height: int, width: int, seed: int) -> Figure:
    """Drawn from the middle of one map, the robot facing up.

    Args:
        world: is drawn.
        targets: (T, 3) poses, as dots.
        height: of a picture [px].
        width: of a picture [px].
        seed: of the map.
    """
    floor = Floor(world.floor, seed)
    pictures = Eyes(floor, world, height, width).picture(np.array([0.0, 0.0, np.pi / 2]))
    figure = new_figure(9.0, 3.3)
    grid = figure.add_gridspec(len(world.camera), 3, width_ratios=[3, 3, 1.2])
    whole, covered = (figure.add_subplot(grid[:, column]) for column in (0, 1))
    half_m = floor.half_m
    texels = floor.texels[::_EVERY_TEXEL, ::_EVERY_TEXEL]
    whole.imshow(texels, "gray", extent=(-half_m, half_m, -half_m, half_m), origin="lower", vmin=0, vmax=255)
    whole.plot([0], [0], "^", markersize=7, color=LINES[2][0], markeredgecolor="white")
    whole.set_title("one map, the robot in its middle", fontsize=TEXT_PT)
    dress(whole, "x of the map [m]", "y of the map [m]")
    covered.plot(targets[:, 1], targets[:, 0], "o", markersize=2, markerfacecolor="none", color="0.6", label="targets")
    for number, camera in enumerate(world.camera):
        colour, _, dash = LINES[number % len(LINES)]
        left_m, ahead_m = outline(Pinhole(camera, height, width)).T[::-1]
        covered.plot(left_m, ahead_m, color=colour, linestyle=dash, linewidth=1.3, label=f"camera {number}")
        view = figure.add_subplot(grid[number, 2])
        view.imshow(pictures[..., number], "gray", vmin=0, vmax=255)
        view.set_title(f"camera {number}", fontsize=SMALL_PT)
        view.set_axis_off()
    x_m, y_m = targets[:, 0], targets[:, 1]
    covered.set(xlim=(y_m.max() + 1, y_m.min() - 1), ylim=(x_m.min() - 1, x_m.max() + 2), aspect="equal")
    covered.legend(fontsize=SMALL_PT, loc="lower left", framealpha=0.9)
    covered.set_title("floor that the cameras cover", fontsize=TEXT_PT)
    dress(covered, "y, to the left [m]", "x, forward [m]")
    return figure


def outline(pinhole: Pinhole) -> Floats:
    """(P, 2) where the picture's edge pixels meet the floor [m], around once; those above the horizon left out."""
    points, _ = pinhole.plane_points(0.0)
    edge = np.concatenate([points[0], points[1:, -1], points[-1, -2::-1], points[-2::-1, 0]])
    return edge[np.isfinite(edge).all(-1)]
