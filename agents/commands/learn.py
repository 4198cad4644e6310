"""`llrp learn`: the online learner, live on a robot or over recordings in virtual time."""

import argparse
import json
from pathlib import Path
from typing import Any

from agents.commands import options
from agents.commands.evaluate import exam_of
from agents.curve import Curve
from agents.replayed import learn_over
from agents.tables import print_bands, print_score
from llrp_online.configuration import RobotConfiguration, load
from llrp_online.digest import weights_sha256
from llrp_online.learner import Learner


def configure(parser: argparse.ArgumentParser) -> None:
    """Its words."""
    options.add_config(parser)
    options.add_json(parser)
    parser.add_argument("--recordings", type=Path, nargs="+", metavar="MCAP", help="learn over these; left out: live")
    parser.add_argument("--output", type=Path, required=True, metavar="RUN", help="folder for checkpoint and report")
    parser.add_argument("--warm-start", type=Path, metavar="CKPT", help="begin with this checkpoint")
    parser.add_argument("--without-memory", action="store_true", help="of the checkpoint take the weights alone")
    parser.add_argument("--resume", type=Path, metavar="CKPT", help="go on exactly where this checkpoint was saved")
    parser.add_argument("--held-out", type=Path, nargs="+", metavar="MCAP", help="recordings to evaluate on meanwhile")
    parser.add_argument(
        "--at-minutes", type=int, nargs="+", default=[1, 2, 5, 10], metavar="N", help="robot minutes to evaluate at"
    )
    parser.add_argument("--seed", type=int, help="instead of training.seed")
    parser.epilog = (
        "examples:\n"
        "  llrp learn --recordings A.mcap B.mcap --config configs/drone.toml --output runs/drone\n"
        "  llrp learn --config configs/thymio.toml --output runs/live    (with `llrp robot` running)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Learn, then say how it went."""
    configuration = with_seed(load(arguments.config), arguments.seed)
    learner = Learner(configuration)
    if arguments.resume:
        learner.load(arguments.resume)
    elif arguments.warm_start:
        learner.warm_start(arguments.warm_start, memory=not arguments.without_memory)
    if arguments.recordings is None:
        from agents.live_learner import learn_live

        return learn_live(learner, arguments.output, arguments.at_minutes)
    exam = exam_of(configuration, arguments.held_out) if arguments.held_out else None
    curve = Curve(exam, arguments.at_minutes)
    learn_over(learner, arguments.recordings, lambda minute: curve.at(minute, learner.trainer.weights()))
    learner.publish_now()
    learner.save(arguments.output / "checkpoint")
    summary = summarise(learner, curve)
    (arguments.output / "report.json").write_text(json.dumps(summary, indent=1))
    if arguments.json:
        print(json.dumps(summary))
    else:
        _print(learner, curve, arguments.output)
    return 0


def with_seed(configuration: RobotConfiguration, seed: int | None) -> RobotConfiguration:
    """The configuration, with another seed if one is given."""
    if seed is None:
        return configuration
    training = configuration.training.model_copy(update={"seed": seed})
    return configuration.model_copy(update={"training": training})


def summarise(learner: Learner, curve: Curve) -> dict[str, Any]:
    """What `--json` prints."""
    status = learner.status()
    return {
        "frames": status.frames,
        "known_labels": sum(status.known),
        "positive_labels": sum(status.positives),
        "robot_s": status.robot_s,
        "steps": status.steps,
        "weights_sha256": weights_sha256(learner.trainer.weights()),
        "prequential": learner.prequential.score().as_json(),
        "prequential_by_distance": [band._asdict() for band in learner.prequential.bands()],
        "learning_curve": curve.as_json(),
        "drift_events": [vars(event) for event in learner.drift_events],
        "config": learner.configuration.model_dump(mode="json"),
        "seed": learner.configuration.training.seed,
    }


def _print(learner: Learner, curve: Curve, output: Path) -> None:
    status = learner.status()
    print(
        f"{status.robot_s / 60:.1f} robot minutes, {status.frames} frames, {sum(status.known)} known labels "
        f"({sum(status.positives)} positive), {status.steps} steps"
    )
    print_score(learner.prequential.score(), "delayed prequential, each frame before it was learned from")
    print_bands(learner.prequential.bands())
    for line in curve.lines():
        print(line)
    print(f"saved to {output}")
