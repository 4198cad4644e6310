"""A checkpoint's network as one ONNX file that needs nothing else: weights inside, and in its metadata how to feed it.

Standardisation is part of the graph, so that a picture goes in as it is: uint8, RGB. What must happen before it, and
what comes out of it, are words in the file's metadata, JSON where they are more than a word: docs/export.md lists them.
"""

import hashlib
import json
from collections.abc import Iterable
from dataclasses import dataclass
from importlib.metadata import version
from typing import cast

import numpy as np
import onnx
import onnxruntime
import torch
from numpy.typing import NDArray
from onnx import numpy_helper

from llrp_online.architecture import DEVIATION_FLOOR, Weights, architecture
from llrp_online.calibration import Calibration
from llrp_online.configuration import RobotConfiguration
from llrp_online.digest import weights_sha256
from llrp_online.graph import PICTURE, PROBABILITIES, build_graph
from llrp_online.network import build, standardise

_RESIZE = "bilinear, pixel centres at halves, edges repeated, no smoothing before, rounded: OpenCV's INTER_LINEAR"
_NORMALISATION = (
    f"in the graph: minus the mean, over the standard deviation (at least {DEVIATION_FLOOR:g} levels), both of all "
    "pixels and channels of the one picture"
)
_MIRRORED = "in the graph: the mean of the logits of the picture and, put back, of its mirror image"
Pictures = Iterable[NDArray[np.uint8]]


@dataclass(frozen=True, eq=False)
class Trained:
    """What is exported.

    Attributes:
        configuration: the robot's.
        weights: as trained.
        version: of the weights.
        calibration: of their probabilities; None: they stay as they are.
    """

    configuration: RobotConfiguration
    weights: Weights
    version: int
    calibration: Calibration | None = None


@dataclass(frozen=True)
class Check:
    """How a file compared with the network it is of.

    Attributes:
        frames: that both were asked about.
        largest_difference: between two probabilities of one cell.
    """

    frames: int
    largest_difference: float


def exported(trained: Trained) -> onnx.ModelProto:
    """The network with its weights, calibrated; ValueError if they are not this configuration's.

    Input: `picture` (1, H, W, C) uint8. Output: `probabilities` (T, S) float32.

    >>> from llrp_online.configuration import load
    >>> configuration = load("configs/thymio.toml")
    >>> network = build("online", configuration.picture_shape, (31, 5))
    >>> model = exported(Trained(configuration, network.weights(), version=7))
    >>> [value.name for value in model.graph.input], metadata(model)["weights_version"]
    (['picture'], '7')
    """
    configuration, weights = trained.configuration, trained.weights
    preset, shape = configuration.network.preset, configuration.picture_shape
    expected = architecture(preset, shape[2]).parameters(shape, configuration.outputs)
    if (found := {name: array.shape for name, array in weights.items()}) != expected:
        raise ValueError(f"these weights are another network's: expected {expected}, got {found}")
    model = build_graph(preset, shape, configuration.outputs, configuration.averaged_with)
    inside = weights if trained.calibration is None else trained.calibration.fold(weights)
    del model.graph.input[1:]
    model.graph.initializer.extend(
        numpy_helper.from_array(np.ascontiguousarray(array, np.float32), name) for name, array in inside.items()
    )
    model.graph.input[0].doc_string = "batch of one, rows, columns, RGB of each camera in turn; levels 0 to 255"
    model.graph.output[0].doc_string = "targets, sensors: probability that the sensor's bit is 1 there"
    model.producer_name, model.producer_version = "llrp-online", version("llrp-online")
    describe(model, _words(trained))
    onnx.checker.check_model(model, full_check=True)
    return model


def describe(model: onnx.ModelProto, words: dict[str, str]) -> None:
    """Add to a model's metadata."""
    for key, value in words.items():
        model.metadata_props.add(key=key, value=value)


def metadata(model: onnx.ModelProto) -> dict[str, str]:
    """A model's metadata."""
    return {entry.key: entry.value for entry in model.metadata_props}


def compare(model: onnx.ModelProto, trained: Trained, pictures: Pictures) -> Check:
    """The exported file on ONNX Runtime beside the network it was trained as, in PyTorch, calibrated after it.

    Args:
        model: as `exported` made it.
        trained: what it is to answer as.
        pictures: (H, W, C) uint8 each.
    """
    configuration = trained.configuration
    network = build(configuration.network.preset, configuration.picture_shape, configuration.outputs).eval()
    network.set_weights(trained.weights)
    calibration = trained.calibration or Calibration.identity(configuration.outputs[0])
    scale, offset = (torch.from_numpy(values)[:, None] for values in (calibration.scale, calibration.offset))
    session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    mirror, frames, largest = configuration.averaged_with, 0, 0.0
    with torch.no_grad():
        for picture in pictures:
            logits = network(standardise(picture[None]))[0]
            if mirror is not None:
                image = network(standardise(picture[None, :, ::-1, mirror.channels]))[0]
                logits = (logits + image[mirror.targets][:, mirror.sensors]) / 2
            expected = torch.sigmoid(scale * logits + offset).numpy()
            got = cast(NDArray[np.float32], session.run([PROBABILITIES], {PICTURE: picture[None]})[0])
            difference = float(np.abs(got - expected).max())
            # A NaN is the largest difference there is; `max` would pass over it.
            largest = difference if not difference <= largest else largest
            frames += 1
    return Check(frames, largest)


def _words(trained: Trained) -> dict[str, str]:
    configuration = trained.configuration
    height, width, _ = configuration.picture_shape
    told = json.dumps(configuration.model_dump(mode="json"), sort_keys=True, allow_nan=False)
    bits = [
        f"{sensor.topic} {sensor.field} {'below' if sensor.below is not None else 'above'} "
        f"{sensor.below if sensor.below is not None else sensor.above:g}"
        for sensor in configuration.short_range
    ]
    return {
        "llrp_version": version("llrp-online"),
        "robot": configuration.robot.name,
        "configuration_sha256": hashlib.sha256(told.encode()).hexdigest(),
        "weights_version": str(trained.version),
        "weights_sha256": weights_sha256(trained.weights),
        "calibration": "none" if trained.calibration is None else json.dumps(trained.calibration.as_json()),
        "network": configuration.network.preset,
        "cameras": json.dumps([camera.topic for camera in configuration.camera]),
        "camera_sync_s": f"{configuration.robot.camera_sync_s:g}",
        "width": str(width),
        "height": str(height),
        "colour": "RGB",
        "resize": _RESIZE,
        "normalisation": _NORMALISATION,
        "mirrored": _MIRRORED if configuration.averaged_with else "no",
        "targets": json.dumps(configuration.targets.build().poses.tolist()),
        "sensors": json.dumps(configuration.sensors),
        "bits": json.dumps(bits),
    }
