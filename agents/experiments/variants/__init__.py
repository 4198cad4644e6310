"""Learners that differ from the usual one by more than a number: `llrp experiment ablate` tries them, nobody else."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from agents.experiments.variants.consistency import ConsistentLearner
from agents.experiments.variants.free_space import FreeSpaceLearner
from agents.experiments.variants.pretraining import pretrained
from agents.experiments.variants.squared import SquaredErrorTrainer
from llrp_online.configuration import RobotConfiguration
from llrp_online.learner import Learner


def made(configuration: RobotConfiguration, folder: Path, variant: Mapping[str, Any] | None) -> Learner:
    """The usual learner (None), or the variant of that name with what else it takes; ValueError if there is none.

    Args:
        configuration: the learner's.
        folder: of what trials share.
        variant: plain values.
    """
    match variant:
        case None:
            return Learner(configuration)
        case {"name": "dropout", "share": share}:
            learner = Learner(configuration)
            learner.trainer.network.dropout.share = share
            return learner
        case {"name": "squared error"}:
            return Learner(configuration, trainer=SquaredErrorTrainer)
        case {"name": "consistency", "share": share}:
            return ConsistentLearner(configuration, share)
        case {"name": "free space", "reach_m": reach_m}:
            return FreeSpaceLearner(configuration, reach_m)
        case {"name": "pretrained", "drives": drives, "steps": steps}:
            return pretrained(configuration, folder, drives, steps)
        case _:
            raise ValueError(f"variant: expected one of those in {__name__}, got {variant!r}")
