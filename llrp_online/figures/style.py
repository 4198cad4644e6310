"""What all figures share: colours, sizes, and the way to a PNG."""

import io

import matplotlib
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import Colormap, ListedColormap
from matplotlib.figure import Figure

#: Text sizes [pt]: print at the figure's own size and they are those of a caption.
TEXT_PT, SMALL_PT = 8.0, 7.0

#: Okabe and Ito's colours, which colour-blind people tell apart; each with a marker and a dash for those who print in
#: grey. Their yellow is left out: it cannot be seen on white.
LINES = [
    ("#000000", "o", "-"),
    ("#0072B2", "s", "--"),
    ("#D55E00", "^", "-."),
    ("#009E73", "D", ":"),
    ("#CC79A7", "v", (0, (5, 1, 1, 1, 1, 1))),
    ("#56B4E9", "P", (0, (8, 2))),
    ("#E69F00", "X", (0, (3, 1))),
]

#: The paper's blue matrix: dark where the sensor fires, light where it does not.
POSITIVE, NEGATIVE = "#08519c", "#c6dbef"
LABELS = ListedColormap([NEGATIVE, POSITIVE])
#: The paper's red heat map.
PREDICTION: Colormap = matplotlib.colormaps["Reds"]
#: AUC, counts, time: each as easy to read for all eyes, and its lightness only rises.
QUANTITY: Colormap = matplotlib.colormaps["cividis"]

#: Behind every map: shows through where nothing is known.
UNKNOWN, UNKNOWN_HATCH = "#d9d9d9", "#8c8c8c"
CHANCE = "#666666"


def new_figure(width_in: float, height_in: float) -> Figure:
    """An empty figure that finds room for its own labels."""
    return Figure(figsize=(width_in, height_in), layout="constrained", facecolor="white")


def dress(axes: Axes, x_label: str, y_label: str) -> None:
    """Axis labels, small ticks, and no frame where there is nothing to read."""
    axes.set_xlabel(x_label, fontsize=TEXT_PT)
    axes.set_ylabel(y_label, fontsize=TEXT_PT)
    axes.tick_params(labelsize=SMALL_PT, length=2.5)
    axes.spines[["top", "right"]].set_visible(False)


def png(figure: Figure, dots_per_inch: int = 160) -> bytes:
    """The figure as a PNG file."""
    FigureCanvasAgg(figure)
    buffer = io.BytesIO()
    # The program's version in the file would make two equal figures differ.
    figure.savefig(buffer, format="png", dpi=dots_per_inch, metadata={"Software": None})
    return buffer.getvalue()
