"""The learner agent: subscribes to a robot's sensors, learns in the background, publishes weights and status."""

import logging
import time
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace

from agents import messages, status, topics, weights
from agents.agent import Agent, joined
from agents.intake import Intake
from agents.learner_commands import obey
from agents.offline import report_drops
from agents.transport import Frames, Received, State, Subscription, serve, subscribe_stream
from llrp_online.background import BackgroundLearner, Listeners
from llrp_online.configuration import RobotConfiguration
from llrp_online.events import Event
from llrp_online.learner import Learner
from llrp_online.publisher import Version
from llrp_online.status import LearnerStatus, whole_minutes
from replay.updates import Updates

_LOG = logging.getLogger(__name__)
#: Labels are for people to look at: so many messages a second are enough.
_LABELS_EVERY_S = 0.2
#: A topic that has not come within this is worth a warning.
_SILENT_S = 5.0


def learn_live(learner: Learner, on_minute: Callable[[int], None]) -> None:
    """Learn until Ctrl-C or SIGTERM; afterwards `learner` is the caller's again.

    Args:
        learner: becomes the background thread's meanwhile.
        on_minute: called in that thread with the minutes lived each time another whole one is over.
    """
    configuration = learner.configuration
    intake = Intake(configuration)
    with joined(configuration, "learner") as agent, ExitStack() as stack:
        voice = _Voice(agent, configuration, intake, on_minute)
        listeners = Listeners(weights=voice.weights, status=voice.status, labels=voice.labels)
        background = stack.enter_context(BackgroundLearner(learner, lambda m: _events(intake, m), listeners))
        command = agent.key(topics.LEARNER_COMMAND)
        stack.enter_context(serve(agent.session, command, lambda data: obey(background.call, data)))
        names = [configuration.odometry.topic, *configuration.range_topics, *(c.topic for c in configuration.camera)]
        for name in names:
            subscription = subscribe_stream(agent.session, agent.key(name), background.submit)
            voice.subscriptions[name] = stack.enter_context(subscription)
        _warn_if_silent(agent, intake)
        while not agent.stop.wait(0.2) and background.failure is None:
            pass
        background.stop()
        voice.time(learner.pace.lived_s)  # a minute that ended since the last status
        report_drops(configuration.robot.name, voice.drops() + learner.labeller.drops + background.drops)
    if background.failure is not None:
        raise RuntimeError(f"the learner has failed: {background.failure!r}") from background.failure


def _warn_if_silent(agent: Agent, intake: Intake) -> None:
    """Say which topics have not come after a few seconds; a learner without them waits in vain."""
    if not agent.stop.wait(_SILENT_S) and (missing := intake.missing()) is not None:
        _LOG.warning("%s: still waiting: %s", agent.robot, missing)


def _events(intake: Intake, message: Received) -> list[Event]:
    return intake.events(message.key, message.type, message.data, message.wall_ns())


class _Voice:
    """What the learner tells others, from its thread."""

    def __init__(
        self, agent: Agent, configuration: RobotConfiguration, intake: Intake, on_minute: Callable[[int], None]
    ) -> None:
        self.subscriptions: dict[str, Subscription] = {}
        self._intake = intake
        self._targets, self._sensors = configuration.targets.build().poses, configuration.sensors
        self._weights = State(agent.session, agent.key(topics.WEIGHTS), "")
        self._status = State(agent.session, agent.key(topics.LEARNER_STATUS), topics.STATUS_TYPE)
        self._labels = Frames(agent.session, agent.key(topics.LABELS), topics.CLOUD_TYPE)
        self._labels_s = 0.0
        self._newest_ns = 0
        self._minute = 0
        self._on_minute = on_minute

    def drops(self) -> Counter[str]:
        """What never came, or came and could not be read."""
        missed = {f"{name}: sent and never came": s.missed for name, s in tuple(self.subscriptions.items())}
        return self._intake.drops + Counter(missed)

    def weights(self, version: Version) -> None:
        self._weights.put(weights.encode(version.outgoing, version.number))

    def status(self, now: LearnerStatus) -> None:
        now = replace(now, drops={**now.drops, **self.drops()})
        self._status.put(status.encode_learner(now, self._newest_ns))
        self.time(now.robot_s)

    def time(self, robot_s: float) -> None:
        """The robot has lived so long."""
        if (minutes := whole_minutes(robot_s)) > self._minute:
            self._minute = minutes
            self._on_minute(minutes)

    def labels(self, updates: Updates) -> None:
        t_ns = int(updates.t_ns[-1])
        self._newest_ns = max(self._newest_ns, t_ns)
        if time.monotonic() - self._labels_s < _LABELS_EVERY_S:
            return
        self._labels_s = time.monotonic()
        cloud = messages.labels(t_ns, self._targets, self._sensors, updates.labels[-1], updates.weight[-1])
        self._labels.put(messages.encode(cloud))
