"""Leave-flights-out: train on some recordings, evaluate on the others, each left out once; beside a baseline.

    python bench/leave_out.py ../shared/data/drone/*.mcap --config configs/drone.toml --folds 7 --steps 1500

Predictions of all folds are pooled before the AUC is taken: one flight alone has too few positives. The baseline is
what anyone would try first: the pictures' first 80 principal components and one logistic regression a label.
"""

import argparse
import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from agents.commands.evaluate import ROUNDS
from agents.offline import labelled_frames
from agents.progress import track, track_recordings
from llrp_online.configuration import RobotConfiguration, load
from llrp_online.metrics import Score
from llrp_online.scoring import Exam
from llrp_online.trainer import Trainer
from replay.buffer import BufferSettings, ReplayBuffer

COMPONENTS, RIDGE = 80, 1.0
Frames = list[tuple[NDArray[np.uint8], NDArray[np.int8], NDArray[np.float32]]]


def network(configuration: RobotConfiguration, train: Frames, test: Frames, steps: int) -> NDArray[np.float32]:
    """(N, T, S) probabilities of the test frames."""
    shape = train[0][1].shape
    settings = BufferSettings(
        budget_bytes=round(configuration.memory.budget_mb * 1e6),
        recent_frames=len(train),
        recent_share=1.0,
        max_uses=int(np.iinfo(np.int32).max),
        duplicate_distance=0.0,
        seed=configuration.training.seed,
    )
    buffer, trainer = ReplayBuffer(configuration.picture_shape, shape, settings), Trainer(configuration)
    for frame_id, frame in enumerate(train):
        buffer.add(frame_id, *frame)
    for _ in track(range(steps), "training", steps):
        batch = buffer.sample(configuration.training.batch)
        assert batch is not None
        trainer.step(batch, buffer.class_counts)
    return Exam(configuration, [(picture, labels) for picture, labels, _ in test]).predict(trainer.weights())


def baseline(train: Frames, test: Frames) -> NDArray[np.float64]:
    """(N, T, S) scores of the test frames."""

    def flat(frames: Frames) -> NDArray[np.float64]:
        pictures = np.stack([picture for picture, _, _ in frames])[..., 0].reshape(len(frames), -1).astype(np.float64)
        return (pictures - pictures.mean(1, keepdims=True)) / np.maximum(pictures.std(1, keepdims=True), 1.0)

    x, y = flat(train), np.stack([labels for _, labels, _ in train])
    mean = x.mean(0)
    basis = np.linalg.svd(x - mean, full_matrices=False)[2][:COMPONENTS]
    features, unseen = (x - mean) @ basis.T, (flat(test) - mean) @ basis.T
    scale = features.std(0)
    features, unseen = features / scale, unseen / scale
    scores = np.zeros((len(test), *y.shape[1:]))
    for cell in np.ndindex(*y.shape[1:]):
        truth = y[(slice(None), *cell)]
        known = truth >= 0
        if len(set(truth[known].tolist())) == 2:
            scores[(slice(None), *cell)] = unseen @ logistic(features[known], truth[known])
    return scores


def logistic(x: NDArray[np.float64], y: NDArray[np.int8]) -> NDArray[np.float64]:
    """Weights (F,) of a logistic regression with a ridge; the intercept does not rank and is left out of the answer."""
    sign = 2.0 * y - 1.0

    def loss(w: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        margin = sign * (x @ w[1:] + w[0])
        pull = -sign / (1 + np.exp(np.clip(margin, -500, 500)))
        value = np.logaddexp(0, -margin).sum() + RIDGE / 2 * (w[1:] ** 2).sum()
        return value, np.concatenate([[pull.sum()], x.T @ pull + RIDGE * w[1:]])

    return minimize(loss, np.zeros(x.shape[1] + 1), jac=True, method="L-BFGS-B").x[1:]


def main() -> None:
    """Print both scores at the distances asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", type=Path, nargs="+")
    parser.add_argument("--config", type=Path, required=True)
    parser.add_argument("--folds", type=int, default=7, help="recordings are dealt out to so many folds")
    parser.add_argument("--steps", type=int, default=1500)
    parser.add_argument("--at", type=float, nargs="+", default=[0.2, 0.6, 1.0], help="target distances [m]")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    configuration = load(arguments.config)
    targets, sensors = configuration.targets.build().poses, configuration.sensors
    recordings: list[Frames] = [
        [(f.picture, f.labels, f.weight) for f in labelled_frames(configuration, path, told) if (f.labels >= 0).any()]
        for path, told in track_recordings(sorted(arguments.recordings), "labelling")
    ]
    guesses: dict[str, list[NDArray[np.floating]]] = {"network": [], "baseline": []}
    truth: list[NDArray[np.int8]] = []
    for fold in range(arguments.folds):
        test = [frame for frames in recordings[fold :: arguments.folds] for frame in frames]
        train = [f for i, frames in enumerate(recordings) if i % arguments.folds != fold for f in frames]
        truth += [labels for _, labels, _ in test]
        guesses["network"].append(network(configuration, train, test, arguments.steps))
        guesses["baseline"].append(baseline(train, test))
    scores = {
        name: Score.of(np.concatenate(parts), np.stack(truth), targets, sensors, rounds=ROUNDS)
        for name, parts in guesses.items()
    }
    if arguments.json:
        print(json.dumps({name: score.as_json() for name, score in scores.items()}))
        return
    for metres in arguments.at:
        row = int(np.abs(targets[:, 0] - metres).argmin())
        for name, score in scores.items():
            cells = ", ".join(
                f"{sensor} {a:.3f} [{low:.2f} {high:.2f}]"
                for sensor, a, low, high in zip(sensors, score.auc[row], score.low[row], score.high[row], strict=True)
            )
            positives, negatives = int(score.n_pos[row].sum()), int(score.n_neg[row].sum())
            print(f"{metres:.1f} m {name:8s} mean {score.auc[row].mean():.3f}: {cells}; n+ {positives}, n- {negatives}")


if __name__ == "__main__":
    main()
