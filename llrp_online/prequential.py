"""Delayed prequential evaluation: test, then train, where the truth comes late.

The prediction made when a frame arrives is kept, and scored when the frame's labels resolve: on data that the network
had never trained on. A label may improve until its frame closes; the last value counts.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from llrp_online.metrics import Floats, Score, counts, pooled_auc
from llrp_online.resampling import ranking, resampled_auc

# A probability of 0 or 1 that proves wrong would cost infinitely much; this bounds it at 9.2 nats.
_CERTAINTY = 1e-4
#: Blocks of neighbouring frames that intervals are drawn from: of two seconds, in a minute.
_BLOCKS = 30


class Band(NamedTuple):
    """How well a band of target distances is predicted.

    Attributes:
        low_m: smallest target distance in it.
        high_m: largest.
        auc: of all its known labels together; None where one class is missing.
        n_pos: known positives.
        n_neg: known negatives.
        log_loss: mean over its known labels [nats]; None where none is known.
    """

    low_m: float
    high_m: float
    auc: float | None
    n_pos: int
    n_neg: int
    log_loss: float | None


class Prequential:
    """Scores predictions as their labels come in, over a window of the newest frames.

    Within the window every figure is exact (by ranks, on float32 probabilities); a frame that leaves it is forgotten.
    Memory is fixed: 5 bytes a label, so 16 MB for 20,000 frames of 155 labels.

    Args:
        targets: (T, 3) float64 target poses; a target's distance is that from the robot.
        sensors: names of the S sensors.
        capacity: how many frames the window holds; more than can wait for labels at any time.

    >>> evaluation = Prequential(np.array([[0.1, 0, 0]]), ["ahead"], capacity=100)
    >>> for frame, (probability, bit) in enumerate([(0.9, 1), (0.3, 0), (0.4, 0)]):
    ...     evaluation.predicted(frame, np.array([[probability]], np.float32))
    ...     _ = evaluation.resolved(np.array([frame]), np.array([[[bit]]], np.int8), closed=np.array([True]))
    >>> evaluation.score().pooled_auc, evaluation.bands()[0].n_neg
    (1.0, 2)
    """

    def __init__(self, targets: Floats, sensors: Sequence[str], capacity: int = 20_000) -> None:
        if capacity < 1:
            raise ValueError(f"capacity: expected at least one frame, got {capacity}")
        self._targets = targets
        self._sensors = tuple(sensors)
        self._edges_m, self._band_of_target = _distance_bands(targets)
        shape = (capacity, len(targets), len(self._sensors))
        self._band_of_label = np.broadcast_to(self._band_of_target[:, None], shape[1:])
        self._probabilities = np.zeros(shape, np.float32)
        self._labels = np.full(shape, -1, np.int8)
        self._frame_ids = np.full(capacity, -1, np.int64)
        self._slots: dict[int, int] = {}
        self._next = 0

    @property
    def band_edges_m(self) -> list[tuple[float, float]]:
        """Smallest and largest target distance of each band, near to far."""
        return list(self._edges_m)

    def predicted(self, frame_id: int, probabilities: NDArray[np.float32]) -> None:
        """Keep what was predicted, (T, S), when frame `frame_id` (not negative, never used before) arrived."""
        if frame_id in self._slots:
            raise ValueError(f"frame {frame_id}: its prediction is kept already; expected one a frame")
        if probabilities.shape != self._labels.shape[1:]:
            raise ValueError(f"probabilities: expected shape {self._labels.shape[1:]}, got {probabilities.shape}")
        slot = self._next
        self._slots.pop(int(self._frame_ids[slot]), None)
        self._probabilities[slot] = probabilities
        self._labels[slot] = -1
        self._frame_ids[slot] = frame_id
        self._slots[frame_id] = slot
        self._next = (slot + 1) % len(self._frame_ids)

    def resolved(
        self, frame_ids: NDArray[np.int64], labels: NDArray[np.int8], closed: NDArray[np.bool_]
    ) -> dict[int, Floats]:
        """Score M different frames by their labels as now known.

        A frame without a kept prediction (none was made, or it left the window) is passed over.

        Args:
            frame_ids: (M,).
            labels: (M, T, S), as now known.
            closed: (M,), which of them are.

        Returns:
            For each closed frame with a prediction, its index among the M, and its mean log-loss by band.
        """
        expected = len(frame_ids), *self._labels.shape[1:]
        if labels.shape != expected or closed.shape != expected[:1]:
            raise ValueError(
                f"expected labels {expected} and closed {expected[:1]}, got shapes {labels.shape} and {closed.shape}"
            )
        slots = np.array([self._slots.get(frame_id, -1) for frame_id in frame_ids.tolist()], np.int64)
        kept = slots >= 0
        self._labels[slots[kept]] = labels[kept]
        return {index: self._band_losses(slots[index]) for index in np.flatnonzero(kept & closed).tolist()}

    def __len__(self) -> int:
        """Frames in the window."""
        return len(self._slots)

    @property
    def band_of_target(self) -> NDArray[np.int64]:
        """(T,), the band that each target is in."""
        return self._band_of_target

    def pairs(self, newest: int | None = None) -> tuple[NDArray[np.float32], NDArray[np.int8]]:
        """(N, T, S) probabilities and labels as now known, of the newest frames predicted (None: all), oldest first."""
        rows = self._rows(newest)
        return self._probabilities[rows], self._labels[rows]

    def score(self, rounds: int = 0, seed: int = 0) -> Score:
        """AUC of each target and sensor over the window; with `rounds` of bootstrap, intervals too."""
        rows = self._rows(None)
        return Score.of(
            self._probabilities[rows], self._labels[rows], self._targets, self._sensors, rounds=rounds, seed=seed
        )

    def bands(self, newest: int | None = None) -> list[Band]:
        """Each band of distances, near to far, over the window or only the `newest` frames predicted (cheaper)."""
        return self._bands(self._rows(newest))

    def _bands(self, rows: NDArray[np.intp] | NDArray[np.int64]) -> list[Band]:
        found: list[Band] = []
        for band, (low_m, high_m) in enumerate(self._edges_m):
            here = np.ix_(rows, np.flatnonzero(self._band_of_target == band))
            labels = self._labels[here]
            known = labels >= 0
            truth, probability = labels[known], self._probabilities[here][known]
            auc = pooled_auc(probability, truth)
            n_pos, n_neg = (int(number) for number in counts(truth))
            log_loss = float(_log_losses(probability, truth).mean()) if len(truth) else None
            found.append(Band(low_m, high_m, None if np.isnan(auc) else auc, n_pos, n_neg, log_loss))
        return found

    def labels(self, frame_id: int) -> NDArray[np.int8] | None:
        """(T, S) labels as now known of a frame predicted; None if the window does not hold it."""
        slot = self._slots.get(frame_id)
        return None if slot is None else self._labels[slot].copy()

    def intervals(
        self, first_id: int, end_id: int, rounds: int, seed: int = 0
    ) -> list[tuple[Band, float | None, float | None]]:
        """Each band over the frames `first_id` to `end_id - 1`, with the 95 % interval of its AUC; empty without any.

        What is drawn again and again are blocks of neighbouring frames, which show much the same.
        """
        rows = np.array([slot for i in range(first_id, end_id) if (slot := self._slots.get(i)) is not None], np.int64)
        if not len(rows):
            return []
        block = np.arange(len(rows)) * _BLOCKS // len(rows)
        times = np.random.default_rng(seed).multinomial(_BLOCKS, np.full(_BLOCKS, 1 / _BLOCKS), rounds).T
        times = np.ascontiguousarray(times, np.int32)
        found: list[tuple[Band, float | None, float | None]] = []
        for band, whole in enumerate(self._bands(rows)):
            here = np.ix_(rows, np.flatnonzero(self._band_of_target == band))
            scores = self._probabilities[here].reshape(-1)
            ranked = ranking(scores, self._labels[here].reshape(-1))
            per_frame = len(scores) // len(rows)
            drawn = resampled_auc(ranked._replace(rows=block[ranked.rows // per_frame]), times)
            drawn = drawn[~np.isnan(drawn)]
            defined = whole.auc is not None and len(drawn) > 0
            low, high = (float(np.quantile(drawn, share)) if defined else None for share in (0.025, 0.975))
            found.append((whole, low, high))
        return found

    def _rows(self, newest: int | None) -> NDArray[np.intp]:
        """Slots of the newest frames (None: of all), oldest first."""
        count = len(self._slots) if newest is None else min(newest, len(self._slots))
        return np.arange(self._next - count, self._next) % len(self._frame_ids)

    def _band_losses(self, slot: int) -> Floats:
        """A frame's mean log-loss by band, NaN where none is known."""
        known = self._labels[slot] >= 0
        bands = self._band_of_label[known]
        losses = _log_losses(self._probabilities[slot][known], self._labels[slot][known])
        count = np.bincount(bands, minlength=len(self._edges_m))
        total = np.bincount(bands, losses, len(self._edges_m))
        return np.divide(total, count, out=np.full(len(count), np.nan), where=count > 0)


def _log_losses(probability: NDArray[np.float32], truth: NDArray[np.int8]) -> Floats:
    """Log-loss of each known label, (K,) and (K,) -> (K,)."""
    of_truth = np.where(truth == 1, probability.astype(np.float64), 1 - probability.astype(np.float64))
    return -np.log(np.maximum(of_truth, _CERTAINTY))


def _distance_bands(targets: Floats, at_most: int = 4) -> tuple[list[tuple[float, float]], NDArray[np.int64]]:
    """The distances that occur, in up to four bands of equally many: edges [m], and the band of each target (T,)."""
    distance_m = np.hypot(targets[:, 0], targets[:, 1]).round(6)
    distinct, which = np.unique(distance_m, return_inverse=True)
    groups = np.array_split(np.arange(len(distinct)), min(at_most, len(distinct)))
    band_of_distance = np.concatenate([np.full(len(group), band) for band, group in enumerate(groups)])
    edges = [(float(distinct[group[0]]), float(distinct[group[-1]])) for group in groups]
    return edges, band_of_distance[which].astype(np.int64)
