"""The trial that most studies are made of: the online learner over drives, its weights tried as it goes."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from agents.commands.evaluate import exam_of
from agents.experiments.drives import Drive
from agents.experiments.settings import plain
from agents.experiments.shared import code, digest, made_once
from agents.experiments.trial import Result, Trial
from agents.experiments.variants import made
from agents.replayed import Marks, learn_over
from llrp_online.configuration import RobotConfiguration
from llrp_online.digest import weights_sha256
from llrp_online.learner import Learner
from llrp_online.scoring import Exam, mean_auc
from llrp_online.trainer import Weights
from replay import compiling

#: Targets no farther than this make the means: as far as the paper's camera sees, and the nearer part.
FAR_M, NEAR_M = 0.25, 0.15


@dataclass(frozen=True)
class Start:
    """What a learner begins with, if not with nothing: another learner's life, lived once and shared by trials.

    Attributes:
        configuration: that learner's, as JSON values.
        lived: its drives, in order.
        memory: take its memory too, not its weights alone.
    """

    configuration: Mapping[str, Any]
    lived: Sequence[Drive]
    memory: bool = True

    @classmethod
    def of(cls, parameters: Mapping[str, Any]) -> "Start":
        """From a trial's parameters."""
        lived = [Drive.of(drive) for drive in parameters["lived"]]
        return cls(parameters["configuration"], lived, parameters["memory"])

    def checkpoint(self, folder: Path) -> Path:
        """From the folder that trials share, or lived now."""
        drives = [drive.as_json() for drive in self.lived]

        def live(part: Path) -> None:
            learner = Learner(RobotConfiguration.model_validate(self.configuration))
            learn_over(learner, [drive.recorded(folder) for drive in self.lived])
            learner.publish_now()
            learner.save(part)

        return made_once(folder / f"start-{digest(self.configuration, drives, code())}", live)


def learning(
    configuration: RobotConfiguration,
    lived: Sequence[Drive],
    exams: Mapping[str, Sequence[Drive]],
    marks_s: Sequence[float],
    *,
    start: Start | None = None,
    frozen: bool = False,
    examiner: RobotConfiguration | None = None,
    variant: Mapping[str, Any] | None = None,
    published: bool = False,
) -> Trial:
    """A trial of `learn`."""
    judged = {} if examiner is None else {"examiner": plain(examiner)}
    judged |= {} if variant is None else {"variant": dict(variant)}
    judged |= {"published": True} if published else {}
    return Trial(
        "agents.experiments.learning:learn",
        {
            "configuration": plain(configuration),
            "lived": [drive.as_json() for drive in lived],
            "exams": {name: [drive.as_json() for drive in drives] for name, drives in exams.items()},
            "marks_s": list(marks_s),
            "start": None if start is None else asdict(start),
            "frozen": frozen,
            **judged,
        },
    )


def learn(
    folder: Path,
    configuration: Mapping[str, Any],
    lived: Sequence[Mapping[str, Any]],
    exams: Mapping[str, Sequence[Mapping[str, Any]]],
    marks_s: Sequence[float],
    start: Mapping[str, Any] | None,
    frozen: bool,
    examiner: Mapping[str, Any] | None = None,
    variant: Mapping[str, Any] | None = None,
    published: bool = False,
) -> Result:
    """Live through drives, in order; the score of the weights at each mark on drives held out.

    Args:
        folder: of what trials share.
        configuration: the learner's, as JSON values; its seed is `training.seed`.
        lived: drives to learn from.
        exams: name -> drives to be judged by.
        marks_s: robot seconds, ascending.
        start: a `Start` as JSON values; None: from nothing.
        frozen: never take a step.
        examiner: configuration that the exams are labelled by, as JSON values; None: the learner's own.
        variant: of the learner, as `variants.made` takes it; None: the usual one.
        published: try the weights that the gate let out last, in place of those that learn; those before the first.

    Returns:
        `marks`: one object a mark with `lived_s`, `driven_m` by odometry, `steps`, `known_labels`, `positive_labels`,
        and for each exam its `far` and `near` (mean AUC to 25 and to 15 cm, None where no cell has enough labels) and
        `cells`; `alarms_s`: when drift was detected, in robot seconds lived; `weights_sha256` of the end.
    """
    form = RobotConfiguration.model_validate(configuration)
    judge = form if examiner is None else RobotConfiguration.model_validate(examiner)
    compiling.use(form.compute.compiled)
    learner, marks = made(form, folder, variant), list[Result]()
    if start is not None:
        begun = Start.of(start)
        learner.warm_start(begun.checkpoint(folder), memory=begun.memory)
    learner.paused = frozen
    tried = {
        name: exam_of(judge, [Drive.of(drive).recorded(folder) for drive in drives]) for name, drives in exams.items()
    }

    def reached(lived_s: float) -> None:
        status, out = learner.status(), learner.publisher.newest
        weights = out.weights if published and out is not None else learner.trainer.weights()
        told = {"lived_s": lived_s, "driven_m": status.driven_m, "steps": status.steps}
        known = {"known_labels": sum(status.known), "positive_labels": sum(status.positives)}
        scores = {name: means(exam, weights) for name, exam in tried.items()}
        marks.append({**told, **known, **scores})

    alarms_s: list[float] = []
    look = Marks(learner, iter(marks_s), reached)

    def watch() -> None:
        look()
        alarms_s.extend([learner.pace.lived_s] * (learner.alarms - len(alarms_s)))

    learn_over(learner, [Drive.of(drive).recorded(folder) for drive in lived], watch)
    return {"marks": marks, "alarms_s": alarms_s, "weights_sha256": weights_sha256(learner.trainer.weights())}


def means(exam: Exam, weights: Weights) -> dict[str, float | int | None]:
    """Mean AUC to 25 cm (`far`) and to 15 cm (`near`), and over how many `cells` the former goes."""
    score = exam.score(weights)
    (far, cells), (near, near_cells) = mean_auc(score, FAR_M), mean_auc(score, NEAR_M)
    return {"far": far if cells else None, "near": near if near_cells else None, "cells": cells}
