"""Message types of particular robots, beside those that every ROS 2 has.

iRobot Create 3, which the TurtleBot 4 stands on: https://github.com/iRobotEducation/irobot_create_msgs. Kobuki, of the
TurtleBot 2: https://github.com/kobuki-base/kobuki_ros_interfaces, and of ROS 1 the same as `kobuki_msgs`.
"""

_BUMPER_EVENT = """
uint8 LEFT=0
uint8 CENTER=1
uint8 RIGHT=2
uint8 RELEASED=0
uint8 PRESSED=1
uint8 bumper
uint8 state
"""

DEFINITIONS = {
    "irobot_create_msgs/msg/IrIntensity": "std_msgs/Header header\nint16 value\n",
    "irobot_create_msgs/msg/IrIntensityVector": ("std_msgs/Header header\nirobot_create_msgs/IrIntensity[] readings\n"),
    "irobot_create_msgs/msg/HazardDetection": """
uint8 BACKUP_LIMIT=0
uint8 BUMP=1
uint8 CLIFF=2
uint8 STALL=3
uint8 WHEEL_DROP=4
uint8 OBJECT_PROXIMITY=5
std_msgs/Header header
uint8 type
""",
    "irobot_create_msgs/msg/HazardDetectionVector": (
        "std_msgs/Header header\nirobot_create_msgs/HazardDetection[] detections\n"
    ),
    "kobuki_ros_interfaces/msg/BumperEvent": _BUMPER_EVENT,
    "kobuki_msgs/msg/BumperEvent": _BUMPER_EVENT,
}
