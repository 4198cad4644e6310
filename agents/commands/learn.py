"""`llrp learn`: the online learner, live on a robot or over recordings in virtual time."""

import argparse
import json
import logging
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import Any

from agents.commands import options
from agents.commands.evaluate import exam_of
from agents.curve import Point, learning_curve
from agents.live_learner import learn_live
from agents.progress import track
from agents.replayed import Marks, learn_over
from agents.run_folder import RunFolder
from agents.tables import print_bands, print_score
from agents.usage import UsageError
from llrp_online.architecture import Weights
from llrp_online.digest import weights_sha256
from llrp_online.learner import Learner
from replay import compiling

_LOG = logging.getLogger(__name__)


def configure(parser: argparse.ArgumentParser) -> None:
    """Its words."""
    options.add_agent(parser)
    options.add_json(parser)
    parser.add_argument("--recordings", type=Path, nargs="+", metavar="MCAP", help="learn over these; left out: live")
    parser.add_argument("--output", type=Path, required=True, metavar="RUN", help="folder for checkpoint and figures")
    parser.add_argument("--warm-start", type=Path, metavar="CKPT", help="begin with this checkpoint")
    parser.add_argument("--without-memory", action="store_true", help="of the checkpoint take the weights alone")
    parser.add_argument("--resume", type=Path, metavar="CKPT", help="go on exactly where this checkpoint was saved")
    parser.add_argument(
        "--at-minutes",
        type=options.whole(1),
        nargs="+",
        default=[1, 2, 5, 10],
        metavar="N",
        help="robot minutes to keep weights of",
    )
    parser.add_argument("--held-out", type=Path, nargs="+", metavar="MCAP", help="try the weights kept on these, then")
    parser.add_argument("--seed", type=options.whole(0), help="instead of training.seed")
    parser.epilog = (
        "examples:\n"
        "  llrp learn --recordings A.mcap B.mcap --config configs/drone.toml --output runs/drone\n"
        "  llrp learn --config configs/thymio.toml --output runs/live    (with `llrp robot` running)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Learn, then say how it went."""
    _must_go_together(arguments)
    options.make_folder(arguments.output)
    if arguments.recordings is None:
        compiling.never_wait()
    learner = Learner(options.load_configuration(arguments))
    if arguments.resume:
        learner.load(arguments.resume)
    elif arguments.warm_start:
        learner.warm_start(arguments.warm_start, memory=not arguments.without_memory)
    folder = RunFolder(arguments.output, arguments.at_minutes)
    if not arguments.resume:
        folder.begin()
    if arguments.recordings is None:
        learn_live(learner, lambda minute: folder.keep_minute(minute, learner))
    else:
        minutes = Marks(learner, count(60, 60), lambda lived_s: folder.keep_minute(round(lived_s / 60), learner))
        learn_over(learner, arguments.recordings, minutes)
    if not learner.status().labelled:
        _LOG.warning("no label became known, so nothing was learned: see `llrp check` for the likely cause")
    learner.publish_now()
    learner.save(folder.checkpoint)
    curve = (
        learning_curve(exam_of(learner.configuration, arguments.held_out), _tried(folder)) if arguments.held_out else []
    )
    summary = summarise(learner, curve)
    (folder.path / "learned.json").write_text(json.dumps(summary, indent=1))
    if arguments.json:
        print(json.dumps(summary))
    else:
        _print(learner, curve, folder)
    return 0


def _tried(folder: RunFolder) -> Iterator[tuple[int, Weights]]:
    kept = list(folder.minutes())
    return track(kept, "trying the weights kept", len(kept))


def _must_go_together(arguments: argparse.Namespace) -> None:
    if arguments.recordings is None and arguments.held_out:
        raise UsageError("--held-out goes with --recordings; live, use `llrp evaluate RUN/minutes/...` afterwards")
    if arguments.resume and arguments.warm_start:
        raise UsageError("--resume goes on exactly, --warm-start begins anew with what was learned: give one of them")
    if arguments.without_memory and not arguments.warm_start:
        raise UsageError("--without-memory goes with --warm-start CKPT")


def summarise(learner: Learner, curve: list[Point]) -> dict[str, Any]:
    """What `--json` prints."""
    status = learner.status()
    return {
        "frames": status.frames,
        "known_labels": sum(status.known),
        "positive_labels": sum(status.positives),
        "robot_s": status.robot_s,
        "steps": status.steps,
        "steps_let_go": status.let_go,
        "weights_sha256": weights_sha256(learner.trainer.weights()),
        "prequential": learner.prequential.score().as_json(),
        "prequential_by_distance": [band._asdict() for band in learner.prequential.bands()],
        "learning_curve": [point.as_json() for point in curve],
        "drift_events": [vars(event) for event in learner.drift_events],
        "config": learner.configuration.model_dump(mode="json"),
        "seed": learner.configuration.training.seed,
    }


def _print(learner: Learner, curve: list[Point], folder: RunFolder) -> None:
    status = learner.status()
    print(
        f"{status.robot_s / 60:.1f} robot minutes, {status.frames} frames, {sum(status.known)} known labels "
        f"({sum(status.positives)} positive), {status.steps} steps, {status.let_go:.0f} let go"
    )
    print_score(learner.prequential.score(), "delayed prequential, each frame before it was learned from")
    print_bands(learner.prequential.bands())
    for point in curve:
        print(point)
    print(f"saved to {folder.path}")
