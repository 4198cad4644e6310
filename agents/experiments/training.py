"""The trial that trains offline, the paper's way: label drives, take steps over them all, score on other drives."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from agents.commands.evaluate import ROUNDS, exam_of
from agents.commands.train import remember, trained
from agents.experiments.drives import Drive
from agents.experiments.trial import Result, Trial
from llrp_online.configuration import RobotConfiguration
from replay import compiling


def training(
    configuration: RobotConfiguration, learned: Sequence[Drive], tested: Mapping[str, Sequence[Drive]], steps: int
) -> Trial:
    """A trial of `train`."""
    return Trial(
        "agents.experiments.training:train",
        {
            "configuration": configuration.model_dump(mode="json"),
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
    """Train offline on drives; name -> the score, as JSON values, on the drives tested, with intervals.

    Args:
        folder: of what trials share.
        configuration: the learner's, as JSON values.
        learned: drives.
        tested: name -> drives, scored together.
        steps: of training.
    """
    form = RobotConfiguration.model_validate(configuration)
    compiling.use(form.compute.compiled)
    trainer, _ = trained(form, remember(form, [Drive.of(drive).recorded(folder) for drive in learned]), steps)
    weights = trainer.weights()
    return {
        name: exam_of(form, [Drive.of(drive).recorded(folder) for drive in drives])
        .score(weights, rounds=ROUNDS)
        .as_json()
        for name, drives in tested.items()
    }
