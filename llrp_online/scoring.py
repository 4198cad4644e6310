"""How well weights predict labelled frames: the predictor over pictures, the score over what is known."""

from collections.abc import Callable, Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from llrp_online.architecture import Weights
from llrp_online.configuration import RobotConfiguration
from llrp_online.metrics import Score
from llrp_online.predictor import Predictor

Watched = Callable[[Sequence[NDArray[np.uint8]]], Iterable[NDArray[np.uint8]]]


class Exam:
    """Labelled frames that weights are tried on, again and again.

    Args:
        configuration: the robot's.
        frames: (picture (H, W, C) uint8, labels (T, S) int8) pairs; at least one.
    """

    def __init__(
        self, configuration: RobotConfiguration, frames: Iterable[tuple[NDArray[np.uint8], NDArray[np.int8]]]
    ) -> None:
        pairs = list(frames)
        if not pairs:
            raise ValueError("no frame with a pose to evaluate on: see `llrp check RECORDING` for the cause")
        self._targets = configuration.targets.build().poses
        self._sensors = configuration.sensors
        self.pictures = [picture for picture, _ in pairs]
        self.labels = np.stack([labels for _, labels in pairs])
        self._predictor = Predictor.of(configuration)

    def predict(self, weights: Weights, watched: Watched = iter) -> NDArray[np.float32]:
        """(N, T, S) probabilities; the pictures are taken by way of `watched`, which may show how far it is."""
        self._predictor.load(weights, version=0)
        return np.stack([self._predictor.predict(picture).probabilities for picture in watched(self.pictures)])

    def score(self, weights: Weights, *, rounds: int = 0, seed: int = 0, watched: Watched = iter) -> Score:
        """The score of these weights; with `rounds` of bootstrap, or without intervals."""
        return Score.of(
            self.predict(weights, watched), self.labels, self._targets, self._sensors, rounds=rounds, seed=seed
        )


#: Known labels of each class that a cell needs to count.
_FEWEST = 10


def enough(score: Score, fewest: int = _FEWEST) -> NDArray[np.bool_]:
    """(T, S) cells with at least so many known positives, and negatives."""
    return (score.n_pos >= fewest) & (score.n_neg >= fewest)


def mean_auc(
    score: Score, farthest_m: float, fewest: int = _FEWEST, sensors: Sequence[int] | None = None
) -> tuple[float, int]:
    """Mean AUC over the cells up to a distance that have enough known labels of both classes, and how many they are.

    Args:
        score: of an evaluation.
        farthest_m: targets no farther than this count.
        fewest: known positives, and negatives, that a cell needs.
        sensors: indices that count; None: all.

    Returns:
        (mean, cells); NaN where no cell has enough.
    """
    near = np.hypot(score.targets[:, 0], score.targets[:, 1]) <= farthest_m + 1e-9
    counted = near[:, None] & enough(score, fewest)
    if sensors is not None:
        counted &= np.isin(np.arange(score.auc.shape[1]), sensors)
    cells = score.auc[counted]
    return (float(cells.mean()) if len(cells) else float("nan")), len(cells)
