"""The control agent: one command for each odometry message, from the newest bits and the newest prediction.

What is older than `transport.stale_s`, by the sensors' clock, does not count; a controller without what it needs stops.
While a person's stop holds, the controller is not asked, and the command is to stand still.
"""

import threading
from collections import Counter
from dataclasses import asdict

import numpy as np
from numpy.typing import NDArray

from agents import messages, status, topics
from agents.agent import Agent
from agents.command import Commands
from agents.controllers import Controller
from agents.halt import Halt
from agents.intake import Intake
from agents.messages import MessageError
from agents.transport import Received, State, subscribe_latest
from llrp_online.configuration import RobotConfiguration
from llrp_online.events import OdometrySample, Reading


class Driver:
    """Drives a robot with a controller.

    Args:
        agent: on whose session it lives.
        configuration: the robot's.
        controller: decides; called from one thread.
        behaviour: what it is called.
    """

    def __init__(
        self, agent: Agent, configuration: RobotConfiguration, controller: Controller, behaviour: str = ""
    ) -> None:
        self._controller, self._behaviour = controller, behaviour
        self._outputs = configuration.outputs
        self._stale_ns = round(configuration.transport.stale_s * 1e9)
        self._intake = Intake(configuration)
        self._turn = threading.Lock()
        self._closed = False
        self._bits: NDArray[np.int8] | None = None
        self._bits_ns = 0
        self._prediction: NDArray[np.float32] | None = None
        self._prediction_ns = 0
        self._first_ns: int | None = None
        self._newest_ns = 0
        self.drops: Counter[str] = Counter()
        self._commands = Commands(agent, configuration)
        self._status = State(agent.session, agent.key(topics.CONTROLLER_STATUS), topics.STATUS_TYPE)
        self._halt = Halt(agent.session, agent.robot, self._halted)
        names = [configuration.odometry.topic, *configuration.range_topics]
        self._subscriptions = [subscribe_latest(agent.session, agent.key(name), self._take) for name in names]
        self._subscriptions.append(subscribe_latest(agent.session, agent.key(topics.PREDICTION), self._see))

    @property
    def robot_s(self) -> float:
        """Sensor time since the first odometry message."""
        return 0.0 if self._first_ns is None else (self._newest_ns - self._first_ns) * 1e-9

    def report(self) -> None:
        """Publish the status; not for two threads at once."""
        now = status.ControllerStatus(self._behaviour, self.robot_s, self._halt.holds)
        self._status.put(status.encode("controller", self._newest_ns, asdict(now)))

    def close(self) -> None:
        """Listen no more, and tell the robot to stand still."""
        for subscription in self._subscriptions:
            subscription.close()
        self._halt.close()
        with self._turn:  # a message that is being handled must not have the last word
            self._closed = True
            self._send(0.0, 0.0)

    def _take(self, message: Received) -> None:
        with self._turn:
            if self._closed:
                return
            for event in self._intake.events(message.key, message.type, message.data, self._newest_ns):
                if isinstance(event, Reading):
                    self._feel(event)
                elif isinstance(event, OdometrySample):
                    self._decide(event)

    def _see(self, message: Received) -> None:
        try:
            cloud = messages.read_prediction(messages.decode(message.type, message.data))
        except MessageError as error:
            self.drops[f"prediction: {error}"] += 1
            return
        if cloud.probabilities.shape != self._outputs or not np.isfinite(cloud.probabilities).all():
            self.drops["prediction: of another shape, or not finite"] += 1
            return
        with self._turn:
            self._prediction, self._prediction_ns = cloud.probabilities, cloud.t_ns

    def _halted(self) -> None:
        """A person has pressed Stop, or let go of it: at once it is to stand, not with the next odometry.

        The word may have been said before this driver was there; then it comes while that is still being built.
        """
        with self._turn:
            if not self._closed:
                self._send(0.0, 0.0)

    def _feel(self, reading: Reading) -> None:
        # Each topic speaks for some of the sensors; the others keep what they said last.
        before = np.full_like(reading.bits, -1) if self._bits is None else self._bits
        self._bits = np.where(reading.bits < 0, before, reading.bits)
        self._bits_ns = reading.t_ns

    def _decide(self, sample: OdometrySample) -> None:
        self._first_ns = sample.t_ns if self._first_ns is None else self._first_ns
        self._newest_ns = sample.t_ns
        if self._halt.holds:
            self._send(0.0, 0.0)
            return
        bits = self._bits if self._is_fresh(self._bits_ns) else None
        prediction = self._prediction if self._is_fresh(self._prediction_ns) else None
        self._send(*self._controller.command(sample.t_ns, sample.pose, bits, prediction))

    def _is_fresh(self, t_ns: int) -> bool:
        # What is far ahead of the clock is from before the clock was set back: as old as can be.
        return abs(self._newest_ns - t_ns) <= self._stale_ns

    def _send(self, speed_m_s: float, turn_rad_s: float) -> None:
        self._commands.send(self._newest_ns, speed_m_s, turn_rad_s)
