"""Messages of real robots' own types, made by hand."""

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import ArrayLike
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.stores.ros2_jazzy import sensor_msgs__msg__LaserScan as LaserScan
from rosbags.typesys.stores.ros2_jazzy import sensor_msgs__msg__Range as Range

from agents import messages
from agents.messages.others import DEFINITIONS

STORE = get_typestore(Stores.ROS2_JAZZY)
for name, text in DEFINITIONS.items():
    STORE.register(get_types_from_msg(text, name))
IR, HAZARD, BUMPER = "irobot_create_msgs/msg/IrIntensity", "irobot_create_msgs/msg/HazardDetection", "BumperEvent"


def scan(
    ranges: ArrayLike, first_rad: float, step_rad: float, limits_m: tuple[float, float], t_ns: int = 0
) -> LaserScan:
    values = np.asarray(ranges, np.float32)
    last = first_rad + step_rad * (len(values) - 1)
    at = messages.header(t_ns, "base_scan")
    return LaserScan(at, first_rad, last, step_rad, 0.0, 0.1, *limits_m, values, np.zeros(0, np.float32))


def sonar(t_ns: int, range_m: float) -> Range:
    return Range(messages.header(t_ns, "sonar"), 0, 0.5, 0.02, 4.0, range_m, 0.0)


def intensities(t_ns: int, values: Mapping[str, int]) -> object:
    readings = [STORE.types[IR](messages.header(t_ns, frame), value) for frame, value in values.items()]
    return STORE.types[IR + "Vector"](messages.header(t_ns, "base_link"), readings)


def hazards(t_ns: int, found: Iterable[tuple[int, str]]) -> object:
    detections = [STORE.types[HAZARD](messages.header(t_ns, frame), kind) for kind, frame in found]
    return STORE.types[HAZARD + "Vector"](messages.header(t_ns, "base_link"), detections)


def bumper_event(bumper: int, state: int, package: str = "kobuki_ros_interfaces") -> object:
    return STORE.types[f"{package}/msg/{BUMPER}"](bumper, state)
