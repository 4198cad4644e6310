"""`llrp evaluate`: how well a checkpoint predicts recordings, for every target and sensor."""

import argparse
import json
import logging
from pathlib import Path

from agents.commands import options
from agents.offline import labelled_frames
from agents.progress import track, track_recordings
from agents.tables import print_score
from llrp_online import checkpoint
from llrp_online.configuration import RobotConfiguration
from llrp_online.scoring import Exam

_LOG = logging.getLogger(__name__)
#: The paper's number of bootstrap rounds.
ROUNDS = 100


def configure(parser: argparse.ArgumentParser) -> None:
    """Its words."""
    options.add_checkpoint(parser)
    options.add_recordings(parser)
    options.add_config(parser)
    options.add_json(parser)
    parser.add_argument(
        "--rounds", type=options.whole(0), default=ROUNDS, help=f"of bootstrap, for the intervals (default {ROUNDS})"
    )
    parser.add_argument("--seed", type=options.whole(0), default=0, help="of the bootstrap (default 0)")
    parser.epilog = (
        "A cell with one class only is blank.\n\n"
        "example:\n  llrp evaluate RUN/checkpoint TEST.mcap --config configs/thymio.toml"
    )


def run(arguments: argparse.Namespace) -> int:
    """Evaluate and print."""
    configuration = options.load_configuration(arguments)
    tensors, manifest = checkpoint.load(arguments.checkpoint)
    checkpoint.must_fit(arguments.checkpoint, manifest, configuration.model_dump(mode="json"))
    exam = exam_of(configuration, arguments.recordings)
    try:
        score = exam.score(
            tensors["weights"],
            rounds=arguments.rounds,
            seed=arguments.seed,
            watched=lambda pictures: track(pictures, "predicting", len(pictures)),
        )
    except ValueError as error:
        raise ValueError(f"{arguments.checkpoint}, with {arguments.config}: {error}") from error
    if arguments.json:
        print(json.dumps(score.as_json()))
    else:
        print_score(score, f"{len(exam.pictures)} frames of {len(arguments.recordings)} recordings")
    return 0


def exam_of(configuration: RobotConfiguration, recordings: list[Path]) -> Exam:
    """The labelled frames of recordings, to try weights on."""
    paths = track_recordings(recordings, "labelling")
    exam = Exam(
        configuration,
        [(frame.picture, frame.labels) for path, told in paths for frame in labelled_frames(configuration, path, told)],
    )
    if not (exam.labels >= 0).any():
        _LOG.warning("no label became known, so every score is blank: see `llrp check` for the likely cause")
    return exam
