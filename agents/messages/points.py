"""Predictions and labels as PointCloud2: one point a target in "base_link", one float32 field a sensor.

RViz and Foxglove draw it as it is: choose a sensor's name as the colour field. Fields x, y, z, yaw say where the target
is; a label that is not known is NaN, and `<sensor>_weight` says how much a known one counts.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from rosbags.typesys.stores.ros2_jazzy import sensor_msgs__msg__PointCloud2 as PointCloud2
from rosbags.typesys.stores.ros2_jazzy import sensor_msgs__msg__PointField as PointField

from agents.messages.codec import MessageError, header, time_ns

_POSE = ("x", "y", "z", "yaw")
_WEIGHT = "_weight"


class PredictionCloud(NamedTuple):
    """What was predicted for a frame.

    Attributes:
        t_ns: the frame's time.
        poses: (T, 3) float64 `[x_m, y_m, yaw_rad]` of the targets, as exact as float32.
        sensors: S names.
        probabilities: (T, S) float32 in [0, 1].
    """

    t_ns: int
    poses: NDArray[np.float64]
    sensors: tuple[str, ...]
    probabilities: NDArray[np.float32]


class LabelCloud(NamedTuple):
    """What a frame's targets turned out to be.

    Attributes:
        t_ns: the frame's time.
        poses: (T, 3) float64 `[x_m, y_m, yaw_rad]` of the targets, as exact as float32.
        sensors: S names.
        labels: (T, S) int8: 1, 0, -1 unknown.
        weight: (T, S) float32 in [0, 1].
    """

    t_ns: int
    poses: NDArray[np.float64]
    sensors: tuple[str, ...]
    labels: NDArray[np.int8]
    weight: NDArray[np.float32]


def prediction(t_ns: int, poses: ArrayLike, sensors: Sequence[str], probabilities: ArrayLike) -> PointCloud2:
    """Probabilities (T, S) at target poses (T, 3).

    >>> cloud = prediction(5, [[0.1, 0.0, 0.0]], ["left", "right"], [[0.25, 0.75]])
    >>> read_prediction(cloud).probabilities.tolist()
    [[0.25, 0.75]]
    """
    return _cloud(t_ns, poses, sensors, np.asarray(probabilities, np.float32))


def labels(t_ns: int, poses: ArrayLike, sensors: Sequence[str], values: ArrayLike, weight: ArrayLike) -> PointCloud2:
    """Labels (T, S) of 1, 0 and -1 unknown, and their weights (T, S), at target poses (T, 3).

    >>> read_labels(labels(5, [[0.1, 0.0, 0.0]], ["left", "right"], [[1, -1]], [[0.5, 0.0]])).labels.tolist()
    [[1, -1]]
    """
    known = np.asarray(values, np.float32)
    known = np.where(known < 0, np.float32(np.nan), known)
    columns = [*sensors, *(sensor + _WEIGHT for sensor in sensors)]
    return _cloud(t_ns, poses, columns, np.concatenate([known, np.asarray(weight, np.float32)], -1))


def read_prediction(message: object) -> PredictionCloud:
    """The other way; MessageError where it is no cloud of ours."""
    t_ns, poses, fields = _columns(message)
    return PredictionCloud(t_ns, poses, tuple(fields), _side_by_side(fields, list(fields), len(poses)))


def read_labels(message: object) -> LabelCloud:
    """The other way; MessageError where it is no cloud of ours."""
    t_ns, poses, fields = _columns(message)
    sensors = [name for name in fields if name + _WEIGHT in fields]
    if 2 * len(sensors) != len(fields):
        raise MessageError(f"not a cloud of labels: expected each sensor with its {_WEIGHT} field, got {list(fields)}")
    known = _side_by_side(fields, sensors, len(poses))
    values = np.where(np.isnan(known), -1, known).astype(np.int8)
    weight = _side_by_side(fields, [sensor + _WEIGHT for sensor in sensors], len(poses))
    return LabelCloud(t_ns, poses, tuple(sensors), values, weight)


def _cloud(t_ns: int, poses: ArrayLike, columns: Sequence[str], values: NDArray[np.float32]) -> PointCloud2:
    at = np.asarray(poses, np.float32)
    if at.ndim != 2 or at.shape[1] != 3 or values.shape != (len(at), len(columns)):
        raise MessageError(
            f"cloud: expected poses (T, 3) and one value a target and column {list(columns)}, "
            f"got shapes {at.shape} and {values.shape}"
        )
    names = [*_POSE, *columns]
    if len(set(names)) < len(names):
        raise MessageError(f"cloud: each field must have a name of its own, got {names}; rename the sensor")
    table = np.concatenate([at[:, :2], np.zeros((len(at), 1), np.float32), at[:, 2:], values], -1, dtype="<f4")
    fields = [PointField(name, 4 * i, PointField.FLOAT32, 1) for i, name in enumerate(names)]
    step = 4 * len(names)
    data = np.frombuffer(table.tobytes(), np.uint8)
    dense = bool(np.isfinite(table).all())
    return PointCloud2(header(t_ns, "base_link"), 1, len(at), fields, False, step, step * len(at), data, dense)


def _columns(message: object) -> tuple[int, NDArray[np.float64], dict[str, NDArray[np.float32]]]:
    """Time, poses (T, 3), and each further field as (T,)."""
    if not isinstance(message, PointCloud2):
        got = getattr(message, "__msgtype__", type(message).__name__)
        raise MessageError(f"expected sensor_msgs/msg/PointCloud2, got {got}")
    count, step = message.width * message.height, message.point_step
    names = [field.name for field in message.fields]
    for field in message.fields:
        if field.datatype != PointField.FLOAT32 or field.offset + 4 > step:
            raise MessageError(f"not a cloud of targets: field {field.name!r} is no float32 within {step} bytes")
    if missing := [name for name in _POSE if name not in names]:
        raise MessageError(f"not a cloud of targets: expected fields {_POSE}, got {names} without {missing}")
    if len(message.data) < count * step:
        raise MessageError(f"not a cloud of targets: {count} points need {count * step} bytes, got {len(message.data)}")
    order = ">" if message.is_bigendian else "<"
    layout = np.dtype(
        {
            "names": names,
            "formats": [order + "f4"] * len(names),
            "offsets": [f.offset for f in message.fields],
            "itemsize": step,
        }
    )
    points = np.frombuffer(message.data[: count * step].tobytes(), layout)
    poses = np.stack([points[name] for name in ("x", "y", "yaw")], -1).astype(np.float64)
    return time_ns(message.header), poses, {n: points[n].astype(np.float32) for n in names if n not in _POSE}


def _side_by_side(fields: dict[str, NDArray[np.float32]], names: list[str], rows: int) -> NDArray[np.float32]:
    return np.stack([fields[name] for name in names], -1) if names else np.zeros((rows, 0), np.float32)
