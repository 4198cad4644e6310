"""`llrp export`: the network of a checkpoint as one ONNX file, held against the network that was trained."""

import argparse
import json
from collections.abc import Iterator
from itertools import chain, islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.commands import options
from agents.frames import frames_of
from agents.progress import track
from llrp_online import checkpoint
from llrp_online.calibration import Calibration
from llrp_online.configuration import RobotConfiguration, validate
from llrp_online.files import replace
from replay import compiling

FRAMES = 1000
#: Both sum in single precision and in another order: what is left of that after a sigmoid is a hundredth of this.
TOLERANCE = 1e-4


def configure(parser: argparse.ArgumentParser) -> None:
    """Its words."""
    options.add_checkpoint(parser)
    parser.add_argument("--onnx", type=Path, required=True, metavar="FILE", help="the file to write")
    parser.add_argument(
        "--recordings",
        type=Path,
        nargs="+",
        default=[],
        metavar="MCAP",
        help="check on their frames; left out: on those that the checkpoint remembers",
    )
    parser.add_argument(
        "--frames", type=options.whole(1), default=FRAMES, help=f"to check on, at most (default {FRAMES})"
    )
    parser.add_argument(
        "--tolerance",
        type=options.positive,
        default=TOLERANCE,
        help=f"largest difference of a probability that is let through (default {TOLERANCE:g})",
    )
    options.add_json(parser)
    parser.epilog = (
        "Exit code 1, and no file, if the file's answers differ from the network's by more than the tolerance.\n\n"
        "examples:\n  llrp export RUN/checkpoint --onnx eyes.onnx\n"
        "  llrp export RUN/minutes/010 --onnx eyes.onnx --recordings TEST.mcap"
    )


def run(arguments: argparse.Namespace) -> int:
    """Build, check, write."""
    options.make_room(arguments.onnx)
    tensors, manifest = checkpoint.load(arguments.checkpoint)
    if "configuration" not in manifest:
        raise ValueError(f"{arguments.checkpoint}: its manifest has no configuration; expected a checkpoint of llrp")
    configuration = validate(manifest["configuration"], RobotConfiguration, f"{arguments.checkpoint}: manifest.json")
    compiling.use(configuration.compute.compiled)
    # Imported here: PyTorch takes seconds, and a fault above should be said at once.
    from llrp_online.export import Trained, compare, describe, exported, metadata

    told = manifest.get("calibration")  # training offline has none
    calibration = None if told is None else Calibration.of_json(told)
    trained = Trained(configuration, tensors["weights"], int(manifest["version"]), calibration)
    try:
        model = exported(trained)
    except ValueError as error:
        raise ValueError(f"{arguments.checkpoint}: {error}") from error
    pictures = islice(_pictures(arguments, configuration), arguments.frames)
    check = compare(model, trained, track(pictures, "checking", arguments.frames))
    if not check.frames:
        raise ValueError(f"{arguments.checkpoint}: it remembers no frame to check on; give --recordings")
    if not check.largest_difference <= arguments.tolerance:
        raise ValueError(
            f"{arguments.onnx}: not written: it differs from the network by {check.largest_difference:.3g} on "
            f"{check.frames} frames, expected at most {arguments.tolerance:g} (--tolerance)"
        )
    checked = {"checked_frames": str(check.frames), "largest_difference": f"{check.largest_difference:.3g}"}
    describe(model, checked)
    replace(arguments.onnx, model.SerializeToString())
    if arguments.json:
        found = {"frames": check.frames, "largest_difference": check.largest_difference}
        print(json.dumps({"onnx": str(arguments.onnx), **found, "metadata": metadata(model)}))
        return 0
    print(
        f"{check.frames} frames, largest difference {check.largest_difference:.3g} "
        f"(at most {arguments.tolerance:g}); saved to {arguments.onnx}"
    )
    return 0


def _pictures(arguments: argparse.Namespace, configuration: RobotConfiguration) -> Iterator[NDArray[np.uint8]]:
    """(H, W, C) uint8 each."""
    if arguments.recordings:
        frames = chain.from_iterable(frames_of(configuration, path) for path in arguments.recordings)
        yield from (frame.picture for frame in frames)
    else:
        yield from _remembered(arguments.checkpoint, arguments.frames)


def _remembered(path: Path, most: int) -> Iterator[NDArray[np.uint8]]:
    """Frames of a checkpoint's memory, at equal steps through all of it, so that they are of the whole drive."""
    sizes = [len(part["pictures"]) for part in checkpoint.load_parts(path, "frames")]
    wanted = np.linspace(0, sum(sizes), min(most, sum(sizes)), endpoint=False).astype(np.int64)
    begin = 0
    for part in checkpoint.load_parts(path, "frames"):
        pictures: Any = part["pictures"]
        inside = wanted[(wanted >= begin) & (wanted < begin + len(pictures))]
        yield from pictures[inside - begin]
        begin += len(pictures)
