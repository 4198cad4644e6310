"""The report of a demo: the weights of each minute on a held-out drive, the pictures, the path, the labels."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from agents.commands.evaluate import ROUNDS
from agents.curve import Point, learning_curve
from agents.demo.show import Outcome, Plan
from agents.intake import Intake
from agents.offline import LabelledFrame, labelled_frames
from agents.progress import share_of, track
from agents.robots.simulated import load_scenario
from agents.run_folder import RunFolder
from agents.simulated_drive import record_drive
from llrp_online.architecture import Weights
from llrp_online.configuration import RobotConfiguration
from llrp_online.events import OdometrySample, Reading
from llrp_online.report import Example, Report, versions, write
from llrp_online.scoring import Exam
from replay.recording import read

#: The held-out layout's seed lies this far from the run's.
HELD_OUT_SEED = 1000
_EXAMPLES = 10


def report(
    plan: Plan, configuration: RobotConfiguration, outcome: Outcome, held_out_minutes: float
) -> tuple[list[Point], Path]:
    """Evaluate on a held-out layout and write report.html and report.json; the learning curve and the page's path."""
    held_out = plan.output / "held_out.mcap"
    record_drive(configuration, load_scenario(plan.scenario), plan.seed + HELD_OUT_SEED, held_out_minutes, held_out)
    with share_of("labelling") as told:
        frames = list(labelled_frames(configuration, held_out, told))
    exam = Exam(configuration, [(frame.picture, frame.labels) for frame in frames])
    minutes = list(RunFolder(plan.output, []).minutes())
    curve = learning_curve(exam, track(minutes, "trying the weights kept", len(minutes)))
    path_s, path, fired = _drive(configuration, plan.recording)
    page = Report(
        title=f"{configuration.robot.name}: {plan.scenario.stem}, seed {plan.seed}",
        configuration=configuration,
        seed=plan.seed,
        versions=versions(),
        facts=_facts(plan, outcome),
        curve=[(p.minute, p.far[0], p.near[0], p.far[1]) for p in curve],
        scores={f"held-out layout after {m} minutes": exam.score(w, rounds=ROUNDS) for m, w in minutes[-1:]},
        examples=_examples(exam, frames, minutes[-1][1]) if minutes else [],
        path=path,
        fired=fired,
        known=_known(outcome, len(configuration.targets.build())),
        path_s=path_s,
    )
    return curve, write(page, plan.output)


def _facts(plan: Plan, outcome: Outcome) -> list[tuple[str, str]]:
    facts = [
        ("scenario", plan.scenario.stem),
        ("held-out layout", f"seed {plan.seed + HELD_OUT_SEED}"),
        ("speed", f"{plan.speed:g} times the clock on the wall"),
    ]
    if (learner := outcome.learner) is not None:
        facts += [
            ("robot time", f"{learner.robot_s / 60:.1f} min"),
            ("frames", f"{learner.frames}, {learner.labelled} of them labelled"),
            ("known labels", f"{sum(learner.known)}, {sum(learner.positives)} of them positive"),
            ("training steps", f"{learner.steps}, {learner.let_go:.0f} let go"),
            ("versions published", f"{learner.version or 0}, {learner.rejected} rejected"),
            ("drift events", str(learner.drift_events)),
        ]
        facts += [
            (
                f"prequential AUC of the newest frames, {band.low_m:.2f} to {band.high_m:.2f} m",
                f"{band.auc:.3f} (n+ {band.n_pos}, n- {band.n_neg})",
            )
            for band in learner.bands
            if band.auc is not None
        ]
        facts += [(f"dropped: {what}", str(count)) for what, count in learner.drops.items()]
    if (perceiver := outcome.perceiver) is not None:
        facts.append(("frame to prediction", f"p50 {perceiver.p50_ms:.1f} ms, p99 {perceiver.p99_ms:.1f} ms"))
    if outcome.explored is not None and outcome.driven is not None:
        driven_s = outcome.driven.robot_s - outcome.explored.robot_s
        facts.append(("exploring", f"{outcome.explored.metres:.1f} m, {outcome.explored.collisions} collisions"))
        facts.append(
            (
                "driving on predictions alone",
                f"{driven_s / 60:.1f} min, {outcome.driven.metres - outcome.explored.metres:.1f} m, "
                f"{outcome.driven.collisions - outcome.explored.collisions} collisions",
            )
        )
    return facts


def _examples(exam: Exam, frames: list[LabelledFrame], weights: Weights) -> list[Example]:
    """Frames spread over the drive, those with a positive label first: the others show an empty floor."""
    positive = [i for i, frame in enumerate(frames) if (frame.labels == 1).any()]
    chosen = np.linspace(0, len(positive) - 1, min(_EXAMPLES, len(positive))).astype(int)
    probabilities = exam.predict(weights)
    return [
        Example(
            frames[i].picture, frames[i].labels, probabilities[i], f"{(frames[i].t_ns - frames[0].t_ns) * 1e-9:.0f} s"
        )
        for i in (positive[c] for c in chosen)
    ]


def _drive(
    configuration: RobotConfiguration, recording: Path
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Times (N,) [s] and poses (N, 3) of the odometry, and where the robot was (M, 2) when a sensor fired."""
    intake = Intake(configuration)
    wanted = {configuration.odometry.topic, *configuration.range_topics}
    times: list[float] = []
    poses: list[NDArray[np.float64]] = []
    fired: list[NDArray[np.float64]] = []
    for message in read(recording):
        if message.topic.removeprefix(f"/{configuration.robot.name}/") not in wanted:
            continue
        for event in intake.events(message.topic, message.type, message.data, message.log_ns):
            if isinstance(event, OdometrySample):
                times.append(event.t_ns * 1e-9)
                poses.append(event.pose)
            elif isinstance(event, Reading) and poses and (event.bits == 1).any():
                fired.append(poses[-1][:2])
    return np.array(times), np.array(poses).reshape(-1, 3), np.array(fired).reshape(-1, 2)


def _known(outcome: Outcome, targets: int) -> NDArray[np.int64]:
    """(T, 2) known negatives and positives."""
    if outcome.learner is None:
        return np.zeros((targets, 2), np.int64)
    known, positives = (np.array(counts, np.int64) for counts in (outcome.learner.known, outcome.learner.positives))
    return np.stack([known - positives, positives], -1)
