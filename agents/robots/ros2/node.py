"""The node: what the robot publishes goes to agents as it is, what agents say goes to the robot as it is.

Nothing is decoded on the way: subscriptions are raw, and CDR is what both sides speak. Type and reliability of each of
the robot's topics are its publishers' own, so that a "best effort" driver is heard as well as one that is not.
"""

import logging
import time
from collections import Counter
from typing import Any

from agents import topics
from agents.agent import Agent
from agents.naming import domain_of, ros_names
from agents.robots.ros2 import library
from agents.transport import Frames, Publisher, Received, Stream, subscribe_latest, subscribe_state, subscribe_stream
from llrp_online.configuration import RobotConfiguration

logger = logging.getLogger(__name__)

#: Messages that may wait for a reader: where every one counts, where only the newest counts, and of what agents say.
_STREAM_DEPTH, _FRAME_DEPTH, _OUT_DEPTH = 200, 10, 10
_LOOK_EVERY_S = 0.2
_SPIN_S = 0.05


class RosNode:
    """A ROS 2 node beside a robot's agents.

    Args:
        agent: on whose session it lives.
        configuration: the robot's; names its topics.

    Attributes:
        handed: messages handed over so far, by topic.
    """

    def __init__(self, agent: Agent, configuration: RobotConfiguration) -> None:
        self.handed: Counter[str] = Counter()
        self._agent, self._names = agent, ros_names(configuration)
        rclpy, self._qos = library.load("rclpy"), library.load("rclpy.qos")
        # A context of its own leaves Ctrl-C to the agent.
        self._context: Any = library.load("rclpy.context").Context()
        rclpy.init(context=self._context, domain_id=domain_of(configuration))
        name = f"llrp_{configuration.robot.name.replace('-', '_')}"
        self._node: Any = rclpy.create_node(name, context=self._context)
        self._executor: Any = library.load("rclpy.executors").SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        cameras = {topics.relative_topic(agent.robot, camera.topic) for camera in configuration.camera}
        self._wanted = {topic: Frames if topic in cameras else Stream for topic in topics.sensed(configuration)}
        self._publishers: dict[str, Publisher] = {}
        for topic, kind in topics.spoken(configuration).items():
            self._speak(topic, kind)

    @property
    def silent(self) -> list[str]:
        """The robot's topics that nobody publishes so far."""
        return [topic for topic in self._wanted if topic not in self._publishers]

    def run(self) -> None:
        """Hand messages over until the agent is to stop."""
        look_s = 0.0
        while not self._agent.stop.is_set():
            if self.silent and time.monotonic() >= look_s:
                self._listen()
                look_s = time.monotonic() + _LOOK_EVERY_S
            self._executor.spin_once(timeout_sec=_SPIN_S)

    def close(self) -> None:
        """Leave ROS 2; what agents say from now on is not handed over."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()

    def _listen(self) -> None:
        """Subscribe to those of the robot's topics that have a publisher by now, as it publishes them."""
        for topic in self.silent:
            name = f"/{self._names.name(self._agent.key(topic))}"
            found: list[Any] = self._node.get_publishers_info_by_topic(name)
            if not found:
                continue
            kind, wanted = str(found[0].topic_type), self._wanted[topic]
            message_class = library.message_class(kind)
            publisher = self._publishers[topic] = wanted(self._agent.session, self._agent.key(topic), kind)
            reliability = self._qos.ReliabilityPolicy
            every = all(info.qos_profile.reliability == reliability.RELIABLE for info in found)
            profile = self._qos.QoSProfile(
                depth=_FRAME_DEPTH if wanted is Frames else _STREAM_DEPTH,
                reliability=reliability.RELIABLE if every else reliability.BEST_EFFORT,
            )

            def hand_over(data: bytes, publisher: Publisher = publisher, topic: str = topic) -> None:
                publisher.put(data)
                self.handed[topic] += 1

            self._node.create_subscription(message_class, name, hand_over, profile, raw=True)

    def _speak(self, topic: str, kind: str) -> None:
        """What agents say on a topic, said in ROS 2."""
        key = self._agent.key(topic)
        state = topic in topics.STATES
        durability = self._qos.DurabilityPolicy
        profile = self._qos.QoSProfile(
            depth=1 if state else _OUT_DEPTH,
            durability=durability.TRANSIENT_LOCAL if state else durability.VOLATILE,
        )
        try:
            message_class = library.message_class(kind)
        except library.RosMissingError as error:
            logger.warning("%s: left out: %s", topic, error)
            return
        publisher: Any = self._node.create_publisher(message_class, f"/{self._names.name(key)}", profile)

        def hand_over(message: Received) -> None:
            if message.type == kind and self._context.ok():
                publisher.publish(message.data)
                self.handed[topic] += 1

        # Of commands the newest counts, even if an older one is then never said; predictions and labels are all said.
        latest, stream = subscribe_latest, subscribe_stream
        subscribe = subscribe_state if state else latest if topic == topics.COMMAND else stream
        subscribe(self._agent.session, key, hand_over)
