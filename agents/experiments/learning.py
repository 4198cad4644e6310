"""The trial that most studies are made of: the online learner over drives, its weights tried as it goes."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from agents.commands.evaluate import exam_of
from agents.experiments.drives import Drive
from agents.experiments.trial import Result, Trial
from agents.replayed import Marks, learn_over
from llrp_online.configuration import RobotConfiguration
from llrp_online.digest import weights_sha256
from llrp_online.learner import Learner
from llrp_online.scoring import mean_auc

#: Targets no farther than this make the means: as far as the paper's camera sees, and the nearer part.
FAR_M, NEAR_M = 0.25, 0.15


def learning(
    configuration: RobotConfiguration, drives: Sequence[Drive], held_out: Sequence[Drive], marks_s: Sequence[float]
) -> Trial:
    """A trial of `learn`."""
    return Trial(
        "agents.experiments.learning:learn",
        {
            "configuration": configuration.model_dump(mode="json"),
            "lived": [drive.as_json() for drive in drives],
            "held_out": [drive.as_json() for drive in held_out],
            "marks_s": list(marks_s),
        },
    )


def learn(
    folder: Path,
    configuration: Mapping[str, Any],
    lived: Sequence[Mapping[str, Any]],
    held_out: Sequence[Mapping[str, Any]],
    marks_s: Sequence[float],
) -> Result:
    """Live through drives, in order; the score of the weights at each mark on drives held out.

    Args:
        folder: of shared drives.
        configuration: the learner's, as JSON values; its seed is `training.seed`.
        lived: drives to learn from.
        held_out: drives to be judged by.
        marks_s: robot seconds, ascending.

    Returns:
        `marks`: one object a mark with `lived_s`, `steps`, `known_labels`, `far`, `near` (mean AUC to 25 and to
        15 cm, None where no cell has enough labels) and `cells`; `weights_sha256` of the end.
    """
    form = RobotConfiguration.model_validate(configuration)
    learner, marks = Learner(form), list[Result]()
    exam = exam_of(form, [Drive.of(drive).recorded(folder) for drive in held_out])

    def reached(lived_s: float) -> None:
        score = exam.score(learner.trainer.weights())
        (far, cells), (near, _) = mean_auc(score, FAR_M), mean_auc(score, NEAR_M)
        status = learner.status()
        marks.append(
            {
                "lived_s": lived_s,
                "steps": status.steps,
                "known_labels": sum(status.known),
                "positive_labels": sum(status.positives),
                "far": far if cells else None,
                "near": near if cells else None,
                "cells": cells,
            }
        )

    learn_over(learner, [Drive.of(drive).recorded(folder) for drive in lived], Marks(learner, iter(marks_s), reached))
    return {"marks": marks, "weights_sha256": weights_sha256(learner.trainer.weights())}
