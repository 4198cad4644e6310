"""`llrp label`: the labels of a recording, by the label rule, to an npz file."""

import argparse
import json
import logging
from pathlib import Path

import numpy as np

from agents.commands import options
from agents.offline import LabelledFrame, labelled_frames

_LOG = logging.getLogger(__name__)


def configure(parser: argparse.ArgumentParser) -> None:
    """Its words."""
    parser.add_argument("recording", type=Path, metavar="RECORDING.mcap")
    options.add_config(parser)
    options.add_output(parser, "npz file: t (N,) s, labels (N, targets, sensors) int8, weight float32")
    options.add_json(parser)
    parser.epilog = "example:\n  llrp label WALK.mcap --config configs/nao.toml --output labels.npz"


def run(arguments: argparse.Namespace) -> int:
    """Label and write."""
    configuration = options.load_configuration(arguments)
    options.make_folder(arguments.output.parent)
    if arguments.output.is_dir():
        raise ValueError(f"{arguments.output}: cannot be written: it is a folder; name a file in it")
    frames = list(labelled_frames(configuration, arguments.recording))
    shape = (len(configuration.targets.build()), len(configuration.sensors))
    arrays = as_arrays(frames, shape)
    with arguments.output.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)
    labels = arrays["labels"]
    known, positive = int((labels >= 0).sum()), int((labels == 1).sum())
    if not known:
        _LOG.warning("no label became known: see `llrp check` for the likely cause")
    if arguments.json:
        print(json.dumps({"frames": len(frames), "known_labels": known, "positive_labels": positive}))
        return 0
    share = 100 * positive / max(known, 1)
    print(f"{len(frames)} frames with a pose, {known} known labels, {share:.1f} % positive")
    for target, pose in enumerate(configuration.targets.build().poses):
        here = (labels[:, target] >= 0).sum(0)
        counts = ", ".join(f"{name} {n}" for name, n in zip(configuration.sensors, here, strict=True))
        print(f"  x {pose[0]:6.2f} m  y {pose[1]:6.2f} m  yaw {pose[2]:5.2f} rad: {counts}")
    return 0


def as_arrays(frames: list[LabelledFrame], shape: tuple[int, int]) -> dict[str, np.ndarray]:
    """Frames as the arrays of the npz file; `shape` is (T, S)."""
    return {
        "t": np.array([frame.t_ns / 1e9 for frame in frames], np.float64),
        "labels": np.array([frame.labels for frame in frames], np.int8).reshape(-1, *shape),
        "weight": np.array([frame.weight for frame in frames], np.float32).reshape(-1, *shape),
    }
