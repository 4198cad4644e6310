"""Commands to the robot, in the type that its configuration names."""

from agents import messages, topics
from agents.agent import Agent
from agents.transport import Frames
from llrp_online.configuration import RobotConfiguration


class Commands:
    """Sends speeds as `Twist`, or as `TwistStamped` where `keys.command_stamped` says so; not for two threads at once.

    Args:
        agent: on whose session it lives.
        configuration: the robot's.
    """

    def __init__(self, agent: Agent, configuration: RobotConfiguration) -> None:
        self._stamped = configuration.keys.command_stamped
        kind = topics.spoken(configuration)[topics.COMMAND]
        self._publisher = Frames(agent.session, agent.key(topics.COMMAND), kind)

    def send(self, t_ns: int, speed_m_s: float, turn_rad_s: float) -> None:
        """One command.

        Args:
            t_ns: the stamp, where the type has one.
            speed_m_s: forward.
            turn_rad_s: counter-clockwise.
        """
        speeds = speed_m_s, turn_rad_s
        command = messages.stamped_twist(t_ns, *speeds) if self._stamped else messages.twist(*speeds)
        self._publisher.put(messages.encode(command))
