"""Probabilities that mean what they say: each band's logits scaled and shifted, by what prequential pairs have shown.

Online Platt scaling (Platt 1999; temperature scaling, Guo et al. 2017, is its scale alone): of the newest predictions
whose labels have resolved, all made before the network was trained on them, each band of target distances fits two
numbers. Within a band the map is monotonic, so no AUC of a cell or band changes. The two numbers fold into the
network's last layer: whoever predicts with the weights needs to know nothing of them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from llrp_online.architecture import Weights

Floats = NDArray[np.float64]

#: How sure the fit is, before any label, that nothing need be changed: as sure as so many labels would make it.
_PRIOR_LABELS = 50.0
#: A probability of 0 or 1 has no logit; this bounds it at 13.8.
_CERTAINTY = 1e-6
_ROUNDS = 20
#: A step of Newton's method below this ends it.
_SMALL = 1e-6
#: No fit makes logits less than a tenth or more than thrice as large: beyond that the labels lie.
_LEAST_SCALE, _MOST_SCALE = 0.1, 3.0


@dataclass(frozen=True, eq=False)
class Calibration:
    """What each target's logits are multiplied by, and what is then added.

    Attributes:
        scale: (T,) float64.
        offset: (T,) float64.
    """

    scale: Floats
    offset: Floats

    @classmethod
    def identity(cls, targets: int) -> Self:
        """Changes nothing.

        >>> Calibration.identity(2).apply(np.array([[[0.25], [0.5]]])).ravel().round(6).tolist()
        [0.25, 0.5]
        """
        return cls(np.ones(targets), np.zeros(targets))

    @classmethod
    def fit(
        cls,
        probabilities: NDArray[np.floating],
        labels: NDArray[np.int8],
        band_of_target: NDArray[np.int64],
        *,
        offset: bool = True,
    ) -> Self:
        """What makes the probabilities likeliest, band by band; a band that lacks a class stays nearly as it is.

        Args:
            probabilities: (N, T, S), uncalibrated.
            labels: (N, T, S) 1, 0 or -1 unknown.
            band_of_target: (T,), which band each target is in.
            offset: fit it too; False: the scale alone, which is temperature scaling.
        """
        if probabilities.shape != labels.shape or labels.shape[1:2] != band_of_target.shape:
            raise ValueError(
                f"expected labels and probabilities (N, T, S) and bands (T,), got {labels.shape}, "
                f"{probabilities.shape} and {band_of_target.shape}"
            )
        scale, shift = np.ones(len(band_of_target)), np.zeros(len(band_of_target))
        for band in np.unique(band_of_target):
            here = band_of_target == band
            known = labels[:, here] >= 0
            logits, truth = _logits(probabilities[:, here][known]), labels[:, here][known].astype(np.float64)
            scale[here], shift[here] = _newton(logits, truth, offset=offset)
        return cls(scale, shift)

    def apply(self, probabilities: NDArray[np.floating]) -> Floats:
        """(N, T, S) probabilities, calibrated."""
        return _sigmoid(np.asarray(self.scale[:, None] * _logits(probabilities) + self.offset[:, None], np.float64))

    def fold(self, weights: Weights) -> dict[str, NDArray[np.float32]]:
        """Weights that predict, uncalibrated, what the given ones do, calibrated; the given ones stay as they are."""
        outputs = weights["outputs.bias"]
        sensors = len(outputs) // len(self.scale)
        scale, offset = np.repeat(self.scale, sensors), np.repeat(self.offset, sensors)
        folded = {name: np.asarray(array, np.float32) for name, array in weights.items()}
        folded["outputs.weight"] = (weights["outputs.weight"] * scale[:, None]).astype(np.float32)
        folded["outputs.bias"] = (outputs * scale + offset).astype(np.float32)
        return folded

    def as_json(self) -> dict[str, list[float]]:
        """Plain values, for `of_json`."""
        return {"scale": self.scale.tolist(), "offset": self.offset.tolist()}

    @classmethod
    def of_json(cls, told: Mapping[str, Any]) -> Self:
        """What `as_json` told."""
        return cls(np.array(told["scale"], np.float64), np.array(told["offset"], np.float64))


def _newton(logits: Floats, truth: Floats, *, offset: bool) -> tuple[float, float]:
    """Scale and offset of the maximum a posteriori; the likelihood is concave, so Newton's method finds it."""
    at = np.array([1.0, 0.0])
    # One label's greatest say is a quarter: so the prior weighs as much as its labels would, at unit logits.
    prior = np.full(2, _PRIOR_LABELS / 4)
    design = np.stack([logits, np.full(len(logits), float(offset))])
    for _ in range(_ROUNDS):
        probability = _sigmoid(at @ design)
        slope = design @ (truth - probability) - prior * (at - [1.0, 0.0])
        curvature = (design * (probability * (1 - probability))) @ design.T + np.diag(prior)
        step = np.clip(np.linalg.solve(curvature, slope), -1.0, 1.0)
        at = at + step
        at[0] = np.clip(at[0], _LEAST_SCALE, _MOST_SCALE)
        if np.abs(step).max() < _SMALL:
            break
    return float(at[0]), float(at[1])


def _logits(probabilities: NDArray[np.floating]) -> Floats:
    bounded: Floats = np.clip(probabilities.astype(np.float64), _CERTAINTY, 1 - _CERTAINTY)
    return np.asarray(np.log(bounded) - np.log1p(-bounded), np.float64)


def _sigmoid(logits: NDArray[np.floating]) -> Floats:
    return np.asarray(1 / (1 + np.exp(-logits)), np.float64)
