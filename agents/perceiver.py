"""The perceiver: the newest frame, the newest weights, a prediction. It trains nothing, so training never delays it.

If the learner dies it goes on with its last good weights. Weights that do not fit are refused and counted.
"""

import logging
import threading
import time
from collections import Counter, deque
from dataclasses import asdict

import numpy as np

from agents import messages, status, topics, weights
from agents.agent import Agent
from agents.intake import Intake
from agents.transport import Frames, Received, State, subscribe_latest, subscribe_state
from llrp_online.configuration import RobotConfiguration
from llrp_online.events import Picture
from llrp_online.predictor import Predictor
from llrp_online.synchroniser import Frame, Synchroniser

_LOG = logging.getLogger(__name__)
#: Frames the latency figures are of: a hundred seconds at 20 Hz.
_LATENCIES = 2000


class Perceiver:
    """Predicts every frame as it comes.

    Args:
        agent: on whose session it lives.
        configuration: the robot's.
    """

    def __init__(self, agent: Agent, configuration: RobotConfiguration) -> None:
        targets = configuration.targets.build()
        self._targets, self._sensors = targets.poses, configuration.sensors
        self._intake = Intake(configuration)
        self._synchroniser = Synchroniser(len(configuration.camera), configuration.robot.camera_sync_s)
        self._predictor = Predictor.of(configuration)
        self._turn = threading.Lock()  # cameras come in threads of their own; a frame is theirs together
        self._latencies_ms: deque[float] = deque(maxlen=_LATENCIES)
        self._arrivals_s: deque[float] = deque(maxlen=_LATENCIES)
        self._frames = 0
        self._newest_ns = 0
        self.drops: Counter[str] = Counter()
        self._prediction = Frames(agent.session, agent.key(topics.PREDICTION), topics.CLOUD_TYPE)
        self._status = State(agent.session, agent.key(topics.PERCEIVER_STATUS), topics.STATUS_TYPE)
        patience_s = configuration.transport.stale_s
        self._subscriptions = [subscribe_state(agent.session, agent.key(topics.WEIGHTS), self._take_weights)]
        self._subscriptions += [
            subscribe_latest(agent.session, agent.key(camera.topic), self._take_picture, patience_s)
            for camera in configuration.camera
        ]

    def close(self) -> None:
        """Predict no more."""
        for subscription in self._subscriptions:
            subscription.close()

    def report(self) -> None:
        """Publish the status."""
        self._status.put(status.encode("perceiver", self._newest_ns, asdict(self.figures())))

    def figures(self) -> status.PerceiverStatus:
        """The status."""
        latencies = list(self._latencies_ms) or [float("nan")]
        p50, p99, p999 = (float(value) for value in np.percentile(latencies, [50, 99, 99.9]))
        lately = [t for t in list(self._arrivals_s) if t > time.monotonic() - 2.0]
        drops = dict(self.drops + self._intake.drops)
        return status.PerceiverStatus(self._frames, len(lately) / 2.0, p50, p99, p999, self._predictor.version, drops)

    def _take_weights(self, message: Received) -> None:
        try:
            self._predictor.load(*weights.decode(message.data))
        except ValueError as error:
            self.drops["weights: refused"] += 1
            _LOG.warning("weights refused, going on with version %s: %s", self._predictor.version, error)

    def _take_picture(self, message: Received) -> None:
        with self._turn:
            for event in self._intake.events(message.key, message.type, message.data, message.wall_ns()):
                if isinstance(event, Picture):
                    for frame in self._synchroniser.add(event):
                        self._predict(frame, message)

    def _predict(self, frame: Frame, message: Received) -> None:
        if self._predictor.version is None:
            return  # a robot without weights sees nothing, and says nothing
        prediction = self._predictor.predict(frame.picture)
        cloud = messages.prediction(frame.t_ns, self._targets, self._sensors, prediction.probabilities)
        self._prediction.put(messages.encode(cloud))
        self._frames += 1
        self._newest_ns = frame.t_ns
        self._latencies_ms.append(message.age_s() * 1e3)
        self._arrivals_s.append(time.monotonic())
