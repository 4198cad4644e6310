"""Standard ROS 2 messages: to and from bytes, and to and from our own arrays.

Frames are REP 103's: x forward, y left, yaw counter-clockwise, metres and radians. Times are integer nanoseconds of the
sensor's clock, in the message's header.
"""

from agents.messages.codec import MessageError, decode, definition, encode, header, stamp_ns, time_ns, type_hash
from agents.messages.pictures import compressed_image, image, jpeg, picture, quick_picture
from agents.messages.points import LabelCloud, PredictionCloud, labels, prediction, read_labels, read_prediction
from agents.messages.poses import odometry, odometry_sample, quick_odometry
from agents.messages.shortcut import flat_picture, flat_scan
from agents.messages.small import (
    diagnostic_array,
    flag,
    laser_scan,
    read_diagnostics,
    read_flag,
    read_twist,
    stamped_twist,
    twist,
)

__all__ = [
    "LabelCloud",
    "MessageError",
    "PredictionCloud",
    "compressed_image",
    "decode",
    "definition",
    "diagnostic_array",
    "encode",
    "flag",
    "flat_picture",
    "flat_scan",
    "header",
    "image",
    "jpeg",
    "labels",
    "laser_scan",
    "odometry",
    "odometry_sample",
    "picture",
    "prediction",
    "quick_odometry",
    "quick_picture",
    "read_diagnostics",
    "read_flag",
    "read_labels",
    "read_prediction",
    "read_twist",
    "stamp_ns",
    "stamped_twist",
    "time_ns",
    "twist",
    "type_hash",
]
