"""The learner agent: subscribes to a robot's sensors, learns in the background, publishes weights and status."""

import json
import logging
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from agents import messages, status, topics, weights
from agents.agent import Agent, joined
from agents.intake import Intake
from agents.offline import report_drops
from agents.transport import Frames, Received, State, serve, subscribe_stream
from llrp_online.background import BackgroundLearner, Listeners
from llrp_online.configuration import RobotConfiguration
from llrp_online.events import Event
from llrp_online.learner import Learner
from llrp_online.publisher import Version
from llrp_online.status import LearnerStatus, whole_minutes
from replay.trajectory import LabelUpdate

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
        voice = _Voice(agent, configuration, on_minute)
        listeners = Listeners(weights=voice.weights, status=voice.status, labels=voice.labels)
        background = stack.enter_context(BackgroundLearner(learner, lambda m: _events(intake, m), listeners))
        command = agent.key(topics.LEARNER_COMMAND)
        stack.enter_context(serve(agent.session, command, lambda data: _obey(background, data)))
        names = [configuration.odometry.topic, *configuration.range_topics, *(c.topic for c in configuration.camera)]
        for name in names:
            stack.enter_context(subscribe_stream(agent.session, agent.key(name), background.submit))
        _warn_if_silent(agent, intake)
        while not agent.stop.wait(0.2) and background.failure is None:
            pass
        background.stop()
        report_drops(configuration.robot.name, intake.drops + learner.labeller.drops + background.drops)
    if background.failure is not None:
        raise RuntimeError(f"the learner has failed: {background.failure!r}") from background.failure


def _warn_if_silent(agent: Agent, intake: Intake) -> None:
    """Say which topics have not come after a few seconds; a learner without them waits in vain."""
    if not agent.stop.wait(_SILENT_S) and (missing := intake.missing()) is not None:
        _LOG.warning("%s: still waiting: %s", agent.robot, missing)


def _events(intake: Intake, message: Received) -> list[Event]:
    received_ns = time.time_ns() if message.sent is None else message.sent.wall_ns
    return intake.events(message.key, message.type, message.data, received_ns)


class _Voice:
    """What the learner tells others, from its thread."""

    def __init__(self, agent: Agent, configuration: RobotConfiguration, on_minute: Callable[[int], None]) -> None:
        self._targets, self._sensors = configuration.targets.build().poses, configuration.sensors
        self._weights = State(agent.session, agent.key(topics.WEIGHTS), "")
        self._status = State(agent.session, agent.key(topics.LEARNER_STATUS), topics.STATUS_TYPE)
        self._labels = Frames(agent.session, agent.key(topics.LABELS), topics.CLOUD_TYPE)
        self._labels_s = 0.0
        self._newest_ns = 0
        self._minute = 0
        self._on_minute = on_minute

    def weights(self, version: Version) -> None:
        self._weights.put(weights.encode(version.weights, version.number))

    def status(self, now: LearnerStatus) -> None:
        self._status.put(status.encode_learner(now, self._newest_ns))
        if (minutes := whole_minutes(now.robot_s)) > self._minute:
            self._minute = minutes
            self._on_minute(minutes)

    def labels(self, updates: list[LabelUpdate]) -> None:
        newest = updates[-1]
        self._newest_ns = max(self._newest_ns, newest.t_ns)
        if time.monotonic() - self._labels_s < _LABELS_EVERY_S:
            return
        self._labels_s = time.monotonic()
        cloud = messages.labels(newest.t_ns, self._targets, self._sensors, newest.labels, newest.weight)
        self._labels.put(messages.encode(cloud))


def _obey(background: BackgroundLearner, data: bytes) -> bytes:
    """A request such as {"command": "save", "path": "runs/a"}; the reply is JSON too."""
    request = json.loads(data)
    command = request.pop("command", None)
    if command not in _COMMANDS:
        raise ValueError(f"command {command!r}: expected one of {sorted(_COMMANDS)}")
    result = background.call(lambda learner: _COMMANDS[command](learner, **request))
    return json.dumps({"command": command, "result": result}).encode()


def _pause(learner: Learner) -> bool:
    learner.paused = True
    return learner.paused


def _resume(learner: Learner) -> bool:
    learner.paused = False
    return learner.paused


def _save(learner: Learner, path: str) -> str:
    learner.save(Path(path))
    return path


def _load(learner: Learner, path: str) -> str:
    learner.load(Path(path))
    return path


def _reset(learner: Learner) -> None:
    learner.reset()


def _roll_back(learner: Learner, version: int) -> int:
    return learner.roll_back(version).number


_COMMANDS: dict[str, Callable[..., Any]] = {
    "pause": _pause,
    "resume": _resume,
    "save": _save,
    "load": _load,
    "reset": _reset,
    "roll_back": _roll_back,
}
