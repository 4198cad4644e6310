"""Trials that drive a simulated robot: on weights that stay as they are, or while they are being learned."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.behaviours import controller
from agents.commands.evaluate import exam_of
from agents.controllers import Controller
from agents.experiments.drives import Drive
from agents.experiments.learning import Start, means
from agents.experiments.trial import Result, Trial
from agents.experiments.truth import NOWHERE, Truth
from agents.intake import Intake
from agents.robots.simulated import Observation, Scenario, SimulatedRobot
from agents.robots.simulated.layout import Layout
from agents.robots.wire import Wire
from agents.rollout import rollout, seen_by
from agents.simulated_drive import simulated_robot
from llrp_online import checkpoint
from llrp_online.calibration import Calibration
from llrp_online.configuration import RobotConfiguration
from llrp_online.learner import Learner
from llrp_online.predictor import Predictor
from llrp_online.trainer import Trainer
from replay import compiling

Sight = Callable[[Observation], NDArray[np.float32] | None]


def driving(drive: Drive, *, sight: str | Mapping[str, Any] | None = None) -> Trial:
    """A trial of `judge`."""
    return Trial("agents.experiments.driving:judge", {"drive": drive.as_json(), "sight": sight})


def judge(folder: Path, drive: Mapping[str, Any], sight: str | Mapping[str, Any] | None) -> Result:
    """Drive through one layout.

    Args:
        folder: of what trials share.
        drive: a `Drive` as JSON values.
        sight: what its controller is given as predictions: a `Start` as JSON values, whose weights predict;
            "untrained", for a network that never learned; "truth", for what the sensors would really feel; None, for
            nothing.

    Returns:
        `collisions`, each contact once; `metres` truly driven; `blocked_s`, how long something stopped it.
    """
    form, robot, pilot = _begun(Drive.of(drive), camera=sight is not None)
    perceive = None if sight is None else _sight(folder, form, robot.layout, sight)
    tally = Tally(robot)
    for seen in rollout(robot, pilot, form, 60 * drive["minutes"], perceive):
        tally.add(seen)
    return tally.told()


def living(drive: Drive, start: Mapping[str, Any], exam: Sequence[Drive]) -> Trial:
    """A trial of `live`."""
    told = {"drive": drive.as_json(), "start": start, "exam": [one.as_json() for one in exam]}
    return Trial("agents.experiments.driving:live", told)


def live(folder: Path, drive: Mapping[str, Any], start: Mapping[str, Any], exam: Sequence[Mapping[str, Any]]) -> Result:
    """Drive and learn at once: what it predicts decides where it drives, and that decides what it learns.

    Args:
        folder: of what trials share.
        drive: a `Drive` as JSON values, of whole minutes; the learner's tables of its configuration count too. Its
            controller is given the newest published weights' predictions.
        start: a `Start` as JSON values.
        exam: drives that the weights are judged by.

    Returns:
        `minutes`: one object a minute with `collisions`, `metres`, `blocked_s`, and the `known_labels` and
        `positive_labels` of frames that closed in it; `before` and `after`: mean AUC as `learning.means` gives it.
    """
    form, robot, pilot = _begun(Drive.of(drive))
    begun = Start.of(start)
    learner = Learner(form)
    learner.warm_start(begun.checkpoint(folder), memory=begun.memory)
    tried = exam_of(form, [Drive.of(one).recorded(folder) for one in exam])
    before = means(tried, learner.trainer.weights())
    driven = rollout(robot, pilot, form, 60 * drive["minutes"], _as_published(learner))
    told: list[Result] = []
    tally, labels = Tally(robot), np.zeros(2, np.int64)
    ticks = round(60 * form.simulated().rate_hz)
    for tick, seen in enumerate(_learning(learner, form, driven), 1):
        tally.add(seen)
        if tick % ticks == 0:
            closed = learner.closed_counts.sum((0, 1))
            new = (closed - labels).tolist()
            told.append({**tally.told(), "known_labels": sum(new), "positive_labels": new[1]})
            tally, labels = Tally(robot), closed
    return {"minutes": told, "before": before, "after": means(tried, learner.trainer.weights())}


def _begun(drive: Drive, *, camera: bool = True) -> tuple[RobotConfiguration, SimulatedRobot, Controller]:
    """What a drive is made of, at its start."""
    form, arena = RobotConfiguration.model_validate(drive.configuration), Scenario.model_validate(drive.scenario)
    compiling.use(form.compute.compiled)
    robot = simulated_robot(form, arena, drive.seed, camera=camera)
    return form, robot, controller(drive.behaviour, form, drive.seed)


def _as_published(learner: Learner) -> Sight:
    """What others predict with the newest weights it published: calibrated, unlike its own predictions."""
    raw = seen_by(learner.predictor)

    def perceive(seen: Observation) -> NDArray[np.float32] | None:
        probabilities, version = raw(seen), learner.publisher.newest
        if probabilities is None or version is None or version.calibration is None:
            return probabilities
        return version.calibration.apply(probabilities[None])[0].astype(np.float32)

    return perceive


def _learning(learner: Learner, form: RobotConfiguration, driven: Iterable[Observation]) -> Iterator[Observation]:
    """The same observations, after the learner has taken each in as it would from the wire."""
    wire, intake = Wire(form), Intake(form)
    for seen in driven:
        for message in wire.messages(seen):
            for event in intake.events(message.topic, message.type, message.data, message.log_ns):
                learner.take(event)
                while learner.due():
                    learner.step()
        yield seen


class Tally:
    """What a drive costs and how far it goes, from now on.

    Args:
        robot: that drives.
    """

    def __init__(self, robot: SimulatedRobot) -> None:
        self._robot, self._collisions = robot, robot.collisions
        self._last: NDArray[np.float64] | None = None
        self._last_ns: int | None = None
        self._metres = self._blocked_s = 0.0

    def add(self, seen: Observation) -> None:
        """Count one tick."""
        if self._last is not None and self._last_ns is not None:
            self._metres += float(np.hypot(*(seen.true_pose[:2] - self._last)))
            self._blocked_s += seen.collided * (seen.t_ns - self._last_ns) * 1e-9
        self._last, self._last_ns = seen.true_pose[:2], seen.t_ns

    def told(self) -> Result:
        """Plain values."""
        collisions = self._robot.collisions - self._collisions
        return {"collisions": collisions, "metres": self._metres, "blocked_s": self._blocked_s}


def _sight(folder: Path, form: RobotConfiguration, layout: Layout, sight: str | Mapping[str, Any]) -> Sight:
    if sight == "truth":
        return _truth(form, layout)
    if isinstance(sight, Mapping):
        tensors, manifest = checkpoint.load(Start.of(sight).checkpoint(folder))
        weights = Calibration.of_json(manifest["calibration"]).fold(tensors["weights"])
    elif sight == "untrained":
        weights = Trainer(form).weights()
    else:
        raise ValueError(f"sight: expected a start, 'untrained', 'truth' or None, got {sight!r}")
    predictor = Predictor.of(form)
    predictor.load(weights, version=1)
    return seen_by(predictor)


def _truth(form: RobotConfiguration, layout: Layout) -> Sight:
    """An oracle: bits where the sensors would really feel something."""
    truth = Truth(form, layout)

    def perceive(seen: Observation) -> NDArray[np.float32]:
        labels = truth.labels(seen.true_pose[None])[0]
        # Where it could not even stand, something is in the way.
        return np.where(labels == NOWHERE, 1, labels).astype(np.float32)

    return perceive
