"""Odometry: a pose in the plane with its 3x3 covariance, inside a message that speaks of space."""

import math
from collections.abc import Sequence
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray
from rosbags.typesys.stores.ros2_jazzy import geometry_msgs__msg__Point as Point
from rosbags.typesys.stores.ros2_jazzy import geometry_msgs__msg__Pose as Pose
from rosbags.typesys.stores.ros2_jazzy import geometry_msgs__msg__PoseWithCovariance as PoseWithCovariance
from rosbags.typesys.stores.ros2_jazzy import geometry_msgs__msg__Quaternion as Quaternion
from rosbags.typesys.stores.ros2_jazzy import geometry_msgs__msg__Twist as Twist
from rosbags.typesys.stores.ros2_jazzy import geometry_msgs__msg__TwistWithCovariance as TwistWithCovariance
from rosbags.typesys.stores.ros2_jazzy import geometry_msgs__msg__Vector3 as Vector3
from rosbags.typesys.stores.ros2_jazzy import nav_msgs__msg__Odometry as Odometry

from agents.messages.codec import MessageError, header, time_ns
from agents.messages.shortcut import FlatOdometry, flat_odometry
from llrp_online.events import OdometrySample

_PLANE = np.ix_([0, 1, 5], [0, 1, 5])  # x, y and yaw among x, y, z, roll, pitch, yaw
_OTHERS = [2, 3, 4]
_PICK = itemgetter(*(6 * row + column for row in (0, 1, 5) for column in (0, 1, 5)))  # the same from a flat matrix
# All zeros mean "not given", so a certain pose needs something else that is not zero: how well a wheeled robot is known
# to stay on the floor.
_OUT_OF_PLANE_VARIANCE = 1e-9
_LARGEST_NORM_ERROR = 0.1


def odometry(sample: OdometrySample, speeds: tuple[float, float] = (0.0, 0.0)) -> Odometry:
    """A pose as nav_msgs/Odometry, from frame "odom" to "base_link"; `speeds` are forward [m/s] and turn [rad/s]."""
    x, y, yaw = (float(value) for value in sample.pose)
    covariance = np.zeros((6, 6))
    if sample.covariance is not None:
        covariance[_PLANE] = sample.covariance
        covariance[_OTHERS, _OTHERS] = _OUT_OF_PLANE_VARIANCE
    pose = Pose(Point(x, y, 0.0), Quaternion(0.0, 0.0, float(np.sin(yaw / 2)), float(np.cos(yaw / 2))))
    twist = Twist(Vector3(speeds[0], 0.0, 0.0), Vector3(0.0, 0.0, speeds[1]))
    return Odometry(
        header(sample.t_ns, "odom"),
        "base_link",
        PoseWithCovariance(pose, covariance.ravel()),
        TwistWithCovariance(twist, np.zeros(36)),
    )


def odometry_sample(message: object) -> OdometrySample:
    """A nav_msgs/Odometry as a pose in the plane; MessageError where its pose is none.

    Yaw is the heading of the robot's x axis seen from above. The covariance is None where it is not given: all zeros, a
    negative variance (-1 by convention), or not finite.

    >>> sample = OdometrySample(5, np.array([1.0, 2.0, 0.5]), np.diag([0.1, 0.2, 0.3]))
    >>> back = odometry_sample(odometry(sample))
    >>> back.t_ns, back.pose.round(6).tolist(), back.covariance.diagonal().tolist()
    (5, [1.0, 2.0, 0.5], [0.1, 0.2, 0.3])
    """
    if not isinstance(message, Odometry):
        raise MessageError(
            f"expected nav_msgs/msg/Odometry, got {getattr(message, '__msgtype__', type(message).__name__)}"
        )
    at, q = message.pose.pose.position, message.pose.pose.orientation
    covariance = message.pose.covariance.tolist()
    return _sample(FlatOdometry(time_ns(message.header), (at.x, at.y, at.z), (q.x, q.y, q.z, q.w), covariance))


def quick_odometry(data: bytes) -> OdometrySample | None:
    """What `odometry_sample` makes of the message in these bytes, sooner; None where they must be decoded.

    >>> from agents.messages import encode
    >>> quick_odometry(encode(odometry(OdometrySample(5, np.array([1.0, 2.0, 0.0]))))).pose.tolist()
    [1.0, 2.0, 0.0]
    """
    flat = flat_odometry(data)
    return None if flat is None else _sample(flat)


def _sample(flat: FlatOdometry) -> OdometrySample:
    x_m, y_m, _ = flat.position
    x, y, z, w = flat.orientation
    yaw_rad = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    if not (math.isfinite(x_m) and math.isfinite(y_m) and math.isfinite(yaw_rad)):
        raise MessageError("a pose that is not finite (NaN or infinite)")
    if abs(math.sqrt(x * x + y * y + z * z + w * w) - 1) > _LARGEST_NORM_ERROR:
        raise MessageError("an orientation that is no unit quaternion")
    return OdometrySample(flat.t_ns, np.array([x_m, y_m, yaw_rad]), _covariance(flat.covariance))


def _covariance(given: Sequence[float]) -> NDArray[np.float64] | None:
    plane = _PICK(given)
    if not any(given) or not all(map(math.isfinite, plane)) or min(plane[0], plane[4], plane[8]) < 0:
        return None
    return np.array(plane).reshape(3, 3)
