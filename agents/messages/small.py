"""The small messages: a fan of ranges, a speed command, a status."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike
from rosbags.typesys.stores.ros2_jazzy import diagnostic_msgs__msg__DiagnosticArray as DiagnosticArray
from rosbags.typesys.stores.ros2_jazzy import diagnostic_msgs__msg__DiagnosticStatus as DiagnosticStatus
from rosbags.typesys.stores.ros2_jazzy import diagnostic_msgs__msg__KeyValue as KeyValue
from rosbags.typesys.stores.ros2_jazzy import geometry_msgs__msg__Twist as Twist
from rosbags.typesys.stores.ros2_jazzy import geometry_msgs__msg__TwistStamped as TwistStamped
from rosbags.typesys.stores.ros2_jazzy import geometry_msgs__msg__Vector3 as Vector3
from rosbags.typesys.stores.ros2_jazzy import sensor_msgs__msg__LaserScan as LaserScan
from rosbags.typesys.stores.ros2_jazzy import std_msgs__msg__Bool as Bool

from agents.messages.codec import MessageError, header


def laser_scan(
    t_ns: int, ranges_m: ArrayLike, angles_rad: tuple[float, float], limits_m: tuple[float, float]
) -> LaserScan:
    """A fan of ranges in "base_link", from the right-most beam to the left-most.

    `ranges_m` (N,): inf where nothing is within reach, NaN where nothing is known. `angles_rad` are the first and the
    last beam's, `limits_m` the least and the greatest range the sensor can give.

    >>> laser_scan(0, [0.05, np.inf], (-0.3, 0.3), (0.0, 0.1)).ranges.tolist()
    [0.05000000074505806, inf]
    """
    ranges = np.asarray(ranges_m, np.float32)
    first, last = angles_rad
    increment = (last - first) / (len(ranges) - 1) if len(ranges) > 1 else 0.0
    at = header(t_ns, "base_link")
    return LaserScan(at, first, last, increment, 0.0, 0.0, *limits_m, ranges, np.zeros(0, np.float32))


def twist(speed_m_s: float, turn_rad_s: float) -> Twist:
    """A speed command: forward and counter-clockwise."""
    return Twist(Vector3(speed_m_s, 0.0, 0.0), Vector3(0.0, 0.0, turn_rad_s))


def stamped_twist(t_ns: int, speed_m_s: float, turn_rad_s: float) -> TwistStamped:
    """The same at a time, of the robot's own frame."""
    return TwistStamped(header(t_ns, "base_link"), twist(speed_m_s, turn_rad_s))


def read_twist(message: object) -> tuple[float, float]:
    """Forward [m/s] and counter-clockwise [rad/s] of a Twist or TwistStamped; MessageError unless both are finite.

    >>> read_twist(twist(0.1, -0.5))
    (0.1, -0.5)
    """
    message = message.twist if isinstance(message, TwistStamped) else message
    if not isinstance(message, Twist):
        raise MessageError(
            f"expected geometry_msgs/msg/Twist, got {getattr(message, '__msgtype__', type(message).__name__)}"
        )
    speeds = message.linear.x, message.angular.z
    if not np.isfinite(speeds).all():
        raise MessageError(f"a speed command that is not finite: {speeds[0]} m/s, {speeds[1]} rad/s")
    return speeds


def flag(value: bool) -> Bool:
    """Yes or no."""
    return Bool(value)


def read_flag(message: object) -> bool:
    """The other way; MessageError where it is none.

    >>> read_flag(flag(True))
    True
    """
    if not isinstance(message, Bool):
        raise MessageError(f"expected std_msgs/msg/Bool, got {getattr(message, '__msgtype__', type(message).__name__)}")
    return bool(message.data)


def diagnostic_array(t_ns: int, name: str, values: Mapping[str, str | float]) -> DiagnosticArray:
    """A flat mapping as one diagnostic status called `name`; numbers keep all their digits.

    >>> read_diagnostics(diagnostic_array(0, "learner", {"state": "training", "steps": 7, "loss": 0.25}))
    {'state': 'training', 'steps': 7, 'loss': 0.25}
    """
    pairs = [KeyValue(key, _text(value)) for key, value in values.items()]
    status = DiagnosticStatus(DiagnosticStatus.OK, name, "", "", pairs)
    return DiagnosticArray(header(t_ns, ""), [status])


def read_diagnostics(message: object) -> dict[str, str | float]:
    """The mapping of a diagnostic array, all its statuses together; what reads as a number comes back as one."""
    if not isinstance(message, DiagnosticArray):
        got = getattr(message, "__msgtype__", type(message).__name__)
        raise MessageError(f"expected diagnostic_msgs/msg/DiagnosticArray, got {got}")
    return {pair.key: _number(pair.value) for status in message.status for pair in status.values}


def _text(value: str | float) -> str:
    # numpy's numbers are numbers here too, and their repr would name their class.
    if isinstance(value, str):
        return value
    return str(int(value)) if isinstance(value, int | np.integer) else repr(float(value))


def _number(text: str) -> str | float:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
