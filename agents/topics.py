"""Names and types of the topics that agents themselves speak; a robot's own are its configuration's."""

from llrp_online.configuration import RobotConfiguration

COMMAND = "cmd_vel"
COMMAND_TYPE = "geometry_msgs/msg/Twist"
STAMPED_COMMAND_TYPE = "geometry_msgs/msg/TwistStamped"
STOP = "stop"
STOP_TYPE = "std_msgs/msg/Bool"
PREDICTION = "prediction"
LABELS = "labels"
CLOUD_TYPE = "sensor_msgs/msg/PointCloud2"
WEIGHTS = "learner/weights"
LEARNER_COMMAND = "learner/command"
LEARNER_STATUS = "learner/status"
PERCEIVER_STATUS = "perceiver/status"
CONTROLLER_STATUS = "controller/status"
ROBOT_STATUS = "robot/status"
STATUS_TYPE = "diagnostic_msgs/msg/DiagnosticArray"
#: What was said last on these holds: who comes later is told it at once.
STATES = frozenset({STOP, LEARNER_STATUS, PERCEIVER_STATUS, CONTROLLER_STATUS, ROBOT_STATUS})
ODOMETRY_TYPE = "nav_msgs/msg/Odometry"


def spoken(configuration: RobotConfiguration) -> dict[str, str]:
    """What agents say in ROS messages, with the types; weights and requests are none."""
    return {
        COMMAND: STAMPED_COMMAND_TYPE if configuration.keys.command_stamped else COMMAND_TYPE,
        STOP: STOP_TYPE,
        PREDICTION: CLOUD_TYPE,
        LABELS: CLOUD_TYPE,
        LEARNER_STATUS: STATUS_TYPE,
        PERCEIVER_STATUS: STATUS_TYPE,
        CONTROLLER_STATUS: STATUS_TYPE,
        ROBOT_STATUS: STATUS_TYPE,
    }


def sensed(configuration: RobotConfiguration) -> dict[str, str]:
    """The robot's own topics that are taken in, each with the type the configuration expects."""
    types = {sensor.topic: sensor.type for sensor in configuration.short_range}
    types |= {camera.topic: camera.type for camera in configuration.camera}
    types[configuration.odometry.topic] = ODOMETRY_TYPE
    return {relative_topic(configuration.robot.name, topic): type_name for topic, type_name in types.items()}


def relative_topic(robot: str, topic: str) -> str:
    """A topic without a leading slash and the robot's name.

    >>> relative_topic("thymio", "/thymio/odom"), relative_topic("thymio", "odom")
    ('odom', 'odom')
    """
    return topic.removeprefix("/").removeprefix(robot + "/")
