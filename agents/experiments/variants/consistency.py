"""State consistency: two frames that look at the same place must agree on it, labelled or not (Nava et al. 2021)."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from llrp_online.configuration import RobotConfiguration
from llrp_online.events import Event, OdometrySample
from llrp_online.labeller import NewFrame
from llrp_online.learner import Learner
from llrp_online.network import standardise
from llrp_online.trainer import Trainer
from replay.poses import relative
from replay.updates import Updates

#: Pairs looked for at each step, and how many frames earlier or later the other one may have been taken.
_PAIRS, _FRAMES = 16, 30


class Pairs(NamedTuple):
    """P pairs of frames along one line.

    Attributes:
        pictures: (2 P, H, W, C) uint8, the first of each pair, then the second of each.
        ahead: (P,) int64, by how many targets the second was taken ahead of the first; at least one.
    """

    pictures: NDArray[np.uint8]
    ahead: NDArray[np.int64]


class ConsistentTrainer(Trainer):
    """Adds to the loss how much pairs of frames disagree.

    Args:
        configuration: the robot's.
        share: what the disagreement weighs.
        pairs: draws some; None if there are none.
    """

    def __init__(self, configuration: RobotConfiguration, share: float, pairs: Callable[[], Pairs | None]) -> None:
        super().__init__(configuration)
        self._share, self._pairs = share, pairs

    def loss(self, pictures: Tensor, labels: Tensor, weight: Tensor, class_counts: NDArray[np.int64]) -> Tensor:
        """Of pictures (N, C, H, W) and their labels and weights, (N, T, S); the pairs go through beside them."""
        pairs = self._pairs()
        if pairs is None:
            return super().loss(pictures, labels, weight, class_counts)
        together = torch.cat([pictures, standardise(pairs.pictures)]).contiguous(memory_format=torch.channels_last)
        logits = self.network(together)
        told, seen = logits[: len(pictures)], torch.sigmoid(logits[len(pictures) :])
        return self.error(told, labels, weight, class_counts) + self._share * disagreement(seen, pairs.ahead)


def disagreement(seen: Tensor, ahead: NDArray[np.int64]) -> Tensor:
    """Mean squared difference between what the frames of each pair say of the places that both look at.

    Args:
        seen: (2 P, T, S) probabilities, the first of each pair, then the second of each.
        ahead: (P,) by how many targets the second is ahead.

    >>> float(disagreement(torch.tensor([[[0.0], [0.5]], [[0.5], [1.0]]]), np.array([1])))
    0.0
    """
    first, second = seen[: len(ahead)], seen[len(ahead) :]
    count = first.shape[1]
    of_each = [
        (one[shift:] - other[: count - shift]).square().mean()
        for one, other, shift in zip(first, second, ahead.tolist(), strict=True)
    ]
    return torch.stack(of_each).mean()


class ConsistentLearner(Learner):
    """Keeps where each frame was taken, and draws pairs of remembered frames that were taken along one line.

    Args:
        configuration: the robot's; its targets lie in line, all heading along it, evenly spaced.
        share: what the disagreement weighs.
    """

    def __init__(self, configuration: RobotConfiguration, share: float) -> None:
        along_m = configuration.targets.build().poses[:, 0]
        self._step_m, self._targets = float(along_m[1] - along_m[0]), len(along_m)
        self._labels = configuration.labels
        self._poses: list[NDArray[np.float64]] = []  # of each frame, by its id
        self._newest = np.full(3, np.nan)
        self._draw = np.random.default_rng(configuration.training.seed)
        super().__init__(configuration, trainer=lambda form: ConsistentTrainer(form, share, self._pairs))

    def take(self, event: Event) -> Updates:
        """As `Learner.take`; notes the pose first."""
        if isinstance(event, OdometrySample):
            self._newest = event.pose
        return super().take(event)

    def _predict(self, frame: NewFrame) -> None:
        self._poses.append(self._newest)
        super()._predict(frame)

    def _pairs(self) -> Pairs | None:
        found = self.buffer.glance(len(self.buffer))
        if found is None:
            return None
        ids, batch = found
        order = np.argsort(ids)
        ids, rows = ids[order], batch.rows[order]
        poses = np.stack(self._poses)[ids]
        first = self._draw.integers(0, len(ids), _PAIRS)
        second = np.clip(first + self._draw.integers(1, _FRAMES + 1, _PAIRS), 0, len(ids) - 1)
        step = relative(poses[first], poses[second])
        ahead = np.rint(np.nan_to_num(step[:, 0]) / self._step_m).astype(np.int64)
        in_line = (np.abs(step[:, 1]) <= self._labels.position_tolerance_m) & (
            np.abs(step[:, 2]) <= self._labels.heading_tolerance_rad
        )
        near = (ids[second] - ids[first] <= _FRAMES) & (ahead != 0) & (np.abs(ahead) < self._targets)
        kept = in_line & near
        if not kept.any():
            return None
        # A robot may back off: the one that stands behind comes first.
        behind = np.where(ahead > 0, first, second)[kept]
        before = np.where(ahead > 0, second, first)[kept]
        pictures = batch.frames.pictures[np.concatenate([rows[behind], rows[before]])]
        return Pairs(pictures, np.abs(ahead[kept]))
