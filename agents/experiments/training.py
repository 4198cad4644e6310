"""The trial that trains offline, the paper's way: label drives, take steps over them all, score on other drives."""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from agents.commands.evaluate import ROUNDS, exam_of
from agents.commands.train import remember, trained
from agents.experiments.drives import Drive
from agents.experiments.settings import plain
from agents.experiments.trial import Result, Trial
from llrp_online.architecture import Weights
from llrp_online.configuration import RobotConfiguration
from llrp_online.scoring import Exam
from replay import compiling

#: An example shows something.
_POSITIVES = 5


def training(
    configuration: RobotConfiguration, learned: Sequence[Drive], tested: Mapping[str, Sequence[Drive]], steps: int
) -> Trial:
    """A trial of `train`."""
    return Trial(
        "agents.experiments.training:train",
        {
            "configuration": plain(configuration),
            "learned": [drive.as_json() for drive in learned],
            "tested": {name: [drive.as_json() for drive in drives] for name, drives in tested.items()},
            "steps": steps,
        },
    )


def train(
    folder: Path,
    configuration: Mapping[str, Any],
    learned: Sequence[Mapping[str, Any]],
    tested: Mapping[str, Sequence[Mapping[str, Any]]],
    steps: int,
) -> Result:
    """Train offline on drives; then score on others.

    Args:
        folder: of what trials share.
        configuration: the learner's, as JSON values.
        learned: drives.
        tested: name -> drives, scored together.
        steps: of training.

    Returns:
        name -> `score`, as JSON values, with intervals; `example`: of the frames tested, the one of which most is
        known and something was met, for `Example.of`.
    """
    form = RobotConfiguration.model_validate(configuration)
    compiling.use(form.compute.compiled)
    trainer, _ = trained(form, remember(form, [Drive.of(drive).recorded(folder) for drive in learned]), steps)
    weights = trainer.weights()
    told: Result = {}
    for name, drives in tested.items():
        exam = exam_of(form, [Drive.of(drive).recorded(folder) for drive in drives])
        score = exam.score(weights, rounds=ROUNDS)
        told[name] = {"score": score.as_json(), "example": Example.told_most(exam, weights).as_json()}
    return told


@dataclass(frozen=True, eq=False)
class Example:
    """A frame, what was predicted and what was found out.

    Attributes:
        picture: (H, W, C) uint8.
        labels: (T, S) int8: 1, 0, -1 unknown.
        probabilities: (T, S) float32.
    """

    picture: NDArray[np.uint8]
    labels: NDArray[np.int8]
    probabilities: NDArray[np.float32]

    @classmethod
    def told_most(cls, exam: Exam, weights: Weights) -> Self:
        """The frame of an exam with the most known labels, of those with at least five positives; first of equals."""
        known, positive = (exam.labels >= 0).sum((1, 2)), (exam.labels == 1).sum((1, 2))
        chosen = int(np.where(positive >= _POSITIVES, known, 0).argmax())
        return cls(exam.pictures[chosen], exam.labels[chosen], exam.predict(weights)[chosen])

    def as_json(self) -> dict[str, Any]:
        """Plain values, for `of`."""
        picture = {"shape": list(self.picture.shape), "base64": base64.b64encode(self.picture.tobytes()).decode()}
        return {"picture": picture, "labels": self.labels.tolist(), "probabilities": self.probabilities.tolist()}

    @classmethod
    def of(cls, told: Mapping[str, Any]) -> Self:
        """What `as_json` told."""
        picture = np.frombuffer(base64.b64decode(told["picture"]["base64"]), np.uint8)
        labels, probabilities = np.array(told["labels"], np.int8), np.array(told["probabilities"], np.float32)
        return cls(picture.reshape(told["picture"]["shape"]), labels, probabilities)
