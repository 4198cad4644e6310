"""The trials of the Pioneer's study: learn from some maps, offline or online, and predict the others."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.experiments.pioneer_drives import PioneerDrive, Recorded, bits_of
from agents.experiments.trial import Result
from llrp_online.configuration import RobotConfiguration
from llrp_online.digest import weights_sha256
from llrp_online.events import OdometrySample, Picture, Reading
from llrp_online.learner import Learner
from llrp_online.metrics import counts
from llrp_online.predictor import Predictor
from llrp_online.resampling import ranking, resampled_auc
from llrp_online.trainer import Trainer, Weights
from replay import compiling
from replay.batch import Batch

#: The paper's number of bootstrap rounds.
ROUNDS = 100
#: The same in every trial: seeds of one half of the maps are averaged round by round, and so need the same draws.
_BOOTSTRAP_SEED = 0
#: Of what a trial tells of an AUC: finer than any interval, and a fifth of the bytes.
_DECIMALS = 5

Drives = Sequence[Mapping[str, Any]]


def offline(folder: Path, configuration: Mapping[str, Any], learned: Drives, tested: Drives, steps: int) -> Result:
    """Learn from all frames of the first drives alike, in so many steps; predict the others. Returns as `exam`."""
    form = RobotConfiguration.model_validate(configuration)
    compiling.use(form.compute.compiled)
    drives = [PioneerDrive(**drive).recorded(folder) for drive in learned]
    labels = np.concatenate([drive.labels for drive in drives])
    begins = np.cumsum([0, *(len(drive.labels) for drive in drives)])
    class_counts = np.stack(counts(labels)[::-1], -1)
    trainer, random, batch = Trainer(form), np.random.default_rng(form.training.seed), form.training.batch
    for _ in range(steps):
        rows = np.sort(random.integers(0, len(labels), batch))
        among = [rows[(rows >= begin) & (rows < end)] - begin for begin, end in pairwise(begins)]
        pictures = np.concatenate([drive.pictures(found) for drive, found in zip(drives, among, strict=True)])
        # Odometry has no noise here, so every label is trusted.
        trainer.step(Batch(pictures, labels[rows], np.ones(labels[rows].shape, np.float32)), class_counts)
    return exam(folder, form, trainer.weights(), drives, tested)


def online(folder: Path, configuration: Mapping[str, Any], learned: Drives, tested: Drives) -> Result:
    """Live through the first drives once, event by event; predict the others. Returns as `exam`."""
    form = RobotConfiguration.model_validate(configuration)
    compiling.use(form.compute.compiled)
    drives, learner = [PioneerDrive(**drive).recorded(folder) for drive in learned], Learner(form)
    for drive in drives:
        live(learner, drive)
    return exam(folder, form, learner.trainer.weights(), drives, tested)


def live(learner: Learner, drive: Recorded) -> None:
    """One recording: at each moment odometry, the floor, then all pictures; training steps when they fall due."""
    (topic,) = learner.configuration.range_topics
    bits = bits_of(learner.configuration, drive.grey)
    for row, t_ns in enumerate(drive.t_ns.tolist()):
        learner.take(OdometrySample(t_ns, drive.poses[row]))
        learner.take(Reading(t_ns, topic, bits[row]))
        picture = drive.pictures(np.array([row]))[0]
        for camera, pixels in enumerate(np.split(picture, len(learner.configuration.camera), axis=-1)):
            learner.take(Picture(t_ns, camera, np.ascontiguousarray(pixels)))
        while learner.due():
            learner.step()
    learner.end_recording()


def exam(
    folder: Path, form: RobotConfiguration, weights: Weights, learned: Sequence[Recorded], tested: Drives
) -> Result:
    """What these weights make of drives that nobody learned from.

    Returns:
        For each target: `auc` (None where one class is known), `n_pos`, `n_neg`, `learned` (labels known in the drives
        learned from); `rounds`, `ROUNDS` lists of each target's AUC as the bootstrap drew it; `frames` and
        `trajectories` tested; `weights_sha256`.
    """
    predictor = Predictor.of(form)
    predictor.load(weights, version=0)
    drives = [PioneerDrive(**drive).recorded(folder) for drive in tested]
    scores = [
        predictor.predict(drive.pictures(np.array([row]))[0]).probabilities[:, 0]
        for drive in drives
        for row in range(len(drive.labels))
    ]
    labels = np.concatenate([drive.labels for drive in drives])
    group = groups([drive.trajectory for drive in drives])
    auc, rounds = resampled(np.stack(scores), labels[..., 0], group, ROUNDS, _BOOTSTRAP_SEED)
    n_pos, n_neg = counts(labels)
    return {
        "auc": _plain(auc),
        "rounds": [_plain(row) for row in rounds],
        "n_pos": n_pos[:, 0].tolist(),
        "n_neg": n_neg[:, 0].tolist(),
        "learned": np.sum([(drive.labels[..., 0] >= 0).sum(0) for drive in learned], 0).tolist(),
        "frames": len(labels),
        "trajectories": int(group.max()) + 1,
        "weights_sha256": weights_sha256(weights),
    }


def groups(trajectories: Sequence[NDArray[np.int64]]) -> NDArray[np.int64]:
    """One number a trajectory, over several drives that each count theirs from 0.

    >>> groups([np.array([0, 0, 1]), np.array([0, 1])]).tolist()
    [0, 0, 1, 2, 3]
    """
    first = np.cumsum([0, *(int(one.max()) + 1 for one in trajectories[:-1])])
    return np.concatenate([one + begin for one, begin in zip(trajectories, first, strict=True)])


def resampled(
    scores: NDArray[np.float32], labels: NDArray[np.int8], group: NDArray[np.int64], rounds: int, seed: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """AUC of each target, and as it comes out when whole trajectories are drawn with replacement.

    Neighbouring frames see the same floor: drawn one by one, as the paper does, they would pass for independent, and
    intervals would come out several times too narrow.

    Args:
        scores: (N, T).
        labels: (N, T) of 1, 0 or -1.
        group: (N,) from 0 on, which trajectory each frame is of.
        rounds: of drawing.
        seed: of drawing.

    Returns:
        (T,) and (rounds, T); NaN where one class is missing. Of labels that all come from one trajectory nothing can be
        drawn: all rounds are NaN there.
    """
    random, number = np.random.default_rng(seed), int(group.max()) + 1
    times = np.empty((len(labels), rounds + 1), np.int32)
    times[:, 0] = 1
    for column in times.T[1:]:
        column[:] = np.bincount(random.integers(0, number, number), minlength=number)[group]
    found = np.stack([resampled_auc(ranking(*cell), times) for cell in zip(scores.T, labels.T, strict=True)], 1)
    alone = [len(np.unique(group[cell >= 0])) < 2 for cell in labels.T]
    found[1:, alone] = np.nan
    return found[0], found[1:]


def _plain(values: NDArray[np.float64]) -> list[float | None]:
    return [None if np.isnan(value) else round(value, _DECIMALS) for value in values.tolist()]
