"""Figures, as the paper draws them (Nava et al. 2019): plain arrays in, a `matplotlib.figure.Figure` out.

No pyplot and no global state, so they can be drawn in any thread and without a display. Every figure can be read in
grey and by colour-blind people: what a colour says is said by lightness, hatching, a marker or a number too.

>>> figure = learning_curve([1, 2], [0.61, 0.74], [None, 0.8], [20, 31])
>>> figure.axes[0].get_xlabel()
'robot time [min]'
"""

from llrp_online.figures.auc_map import auc_map
from llrp_online.figures.curves import auc_by_distance, learning_curve
from llrp_online.figures.examples import examples
from llrp_online.figures.known_labels import known_labels
from llrp_online.figures.style import png
from llrp_online.figures.trajectory import trajectory
from llrp_online.figures.windows import WindowPanel, windows

__all__ = [
    "WindowPanel",
    "auc_by_distance",
    "auc_map",
    "examples",
    "known_labels",
    "learning_curve",
    "png",
    "trajectory",
    "windows",
]
