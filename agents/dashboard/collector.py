"""What the dashboard knows: a robot's topics, polled, and all that is kept of them.

Topics are taken from bounded rings when the clock ticks, and not as they come: ten looks a second cost little however
fast the robot speaks, and who looks on can hold up nobody.
"""

import math
import threading
import time
from collections import deque
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from agents import messages, status, topics
from agents.agent import Agent
from agents.dashboard.diagnosis import SILENT_S, Evidence, Finding, diagnose
from agents.dashboard.ground import Ground, Misses, Window
from agents.dashboard.past import Pasts
from agents.dashboard.questions import Questions
from agents.dashboard.sights import KEPT, Shot, Sights
from agents.dashboard.thinning import Thinning
from agents.intake import Intake
from agents.messages import MessageError
from agents.messages.points import PredictionCloud
from agents.transport import Polled, Received, subscribe_state, watch
from llrp_online.configuration import RobotConfiguration
from llrp_online.events import OdometrySample, Reading
from llrp_online.status import LearnerStatus

#: Messages of odometry and short range between two looks; a robot that says more than this is seen with gaps.
_DEPTH = 512
#: Robot time between two poses that are taken in: as often as they are drawn, however often they come.
_POSES_NS = 90_000_000
_SLOWLY_S = 1.0
#: The learner's status this long ago is what its newest is compared with.
_BEFORE_S = 20.0
_MOVED_WITHIN_S = 10.0
_RATE_S = 3.0
#: What is wrong with a message that nothing was dropped of: of a sensor, of a camera.
_UNREAD = "nothing in it that the configuration names", "not a picture that can be read"


class Heard:
    """When a topic was heard, and how often lately."""

    def __init__(self) -> None:
        self._times_s: deque[tuple[float, int]] = deque()
        self.last_s: float | None = None

    def heard(self, count: int, now_s: float) -> None:
        """So many messages have come since the last look."""
        if count:
            self.last_s = now_s
        self._times_s.append((now_s, count))
        while self._times_s and now_s - self._times_s[0][0] > _RATE_S:
            self._times_s.popleft()

    def age_s(self, now_s: float) -> float | None:
        """Since the last; None: it never came."""
        return None if self.last_s is None else now_s - self.last_s

    @property
    def per_s(self) -> float:
        """Lately."""
        return sum(count for _, count in self._times_s) / _RATE_S


class Collector:
    """Looks at a robot's topics ten times a second; all it holds is read and written under `lock`.

    Args:
        agent: on whose session it lives.
        configuration: the robot's.

    Attributes:
        learner, perceiver, controller, robot: the newest status of each, None before the first.
        agents: name -> is it there.
        prediction: the newest, as (T, S) uint8, 255 for certainty; None before the first.
        shots: the pictures it was made of, or the newest ones if there is no prediction of them.
        predicted: `prediction` was made of `shots`.
    """

    def __init__(self, agent: Agent, configuration: RobotConfiguration) -> None:
        self.configuration = configuration
        self.lock = threading.Lock()
        self.sights, self.ground, self.pasts = Sights(configuration), Ground(configuration), Pasts()
        self.learner: LearnerStatus | None = None
        self.perceiver: status.PerceiverStatus | None = None
        self.controller: status.ControllerStatus | None = None
        self.robot: status.RobotStatus | status.ThymioStatus | None = None
        self.agents: dict[str, bool] = {}
        self.prediction: NDArray[np.uint8] | None = None
        self.prediction_ns = 0
        self.shots: tuple[Shot, ...] | None = None
        self.predicted = False
        self.stopped = False
        self.window: Window | None = None
        self.findings: list[Finding] = []
        self.heard_s: dict[str, float] = {}
        self._statuses: deque[tuple[float, LearnerStatus]] = deque()
        self._intake = Intake(configuration)
        self._began_s = time.monotonic()
        self._slowly_s = 0.0
        self._used_s: dict[str, float] = {}  # topic -> when something that came on it could be used
        self._frozen_since_s: dict[int, float] = {}
        self._outputs = configuration.outputs
        session = agent.session
        self._moved = [configuration.odometry.topic, *configuration.range_topics]
        self._poses = Thinning(topics.ODOMETRY_TYPE, _POSES_NS)
        self._cameras = [camera.topic for camera in configuration.camera]
        depths = dict.fromkeys(self._moved, _DEPTH) | dict.fromkeys(self._cameras, KEPT)
        depths[topics.PREDICTION] = KEPT
        self._polled = {name: Polled(session, agent.key(name), depth) for name, depth in depths.items()}
        self.heard = {name: Heard() for name in depths}
        self._subscriptions = [
            subscribe_state(session, agent.key(topic), self._hear)
            for topic in (
                topics.LEARNER_STATUS,
                topics.PERCEIVER_STATUS,
                topics.CONTROLLER_STATUS,
                topics.ROBOT_STATUS,
            )
        ]
        self._subscriptions.append(subscribe_state(session, agent.key(topics.STOP), self._hear_stop))
        self._presence = watch(session, agent.robot, self._come_or_go)
        settle_s = configuration.labels.window_s + configuration.odometry.max_delay_s
        self.questions = Questions(session, agent.robot, self.pasts, self.lock, lambda: self.ground.now_ns, settle_s)

    def close(self) -> None:
        """Look no more."""
        self.questions.close()
        self._presence.close()
        for subscription in self._subscriptions:
            subscription.close()
        for polled in self._polled.values():
            polled.close()

    def tick(self) -> None:
        """Take in what has come, and once a second think about it."""
        now_s = time.monotonic()
        came = {name: polled.take() for name, polled in self._polled.items()}
        with self.lock:
            for name, some in came.items():
                self.heard[name].heard(len(some), now_s)
            odometry = self.configuration.odometry.topic
            came[odometry] = list(self._poses.of(came[odometry]))
            for name in self._moved:
                if sum(self._sense(message) for message in came[name]):
                    self._used_s[name] = now_s
            for index, name in enumerate(self._cameras):
                if sum(self.sights.add(index, message) for message in came[name]):
                    self._used_s[name] = now_s
            # The newest of a picture that is kept; those before it are not looked at.
            any(self._predicted(message) for message in reversed(came[topics.PREDICTION]))
            self._show_newest(now_s)
            self._mind_the_cameras(now_s)
            if now_s - self._slowly_s >= _SLOWLY_S:
                self._slowly_s = now_s
                self.window = self.ground.window()
                self.findings = diagnose(self.evidence(now_s))

    # --- what comes

    def _sense(self, message: Received) -> bool:
        """Take in what a message says of odometry and short range; False if that is nothing."""
        events = self._intake.events(message.key, message.type, message.data, message.wall_ns())
        for event in events:
            if isinstance(event, OdometrySample):
                epoch = self.ground.epoch
                self.ground.odometry(event)
                if self.ground.epoch != epoch:
                    self.pasts.clear()
            elif isinstance(event, Reading):
                self.ground.reading(event)
        return bool(events)

    def _predicted(self, message: Received) -> bool:
        """Show a prediction with the picture it was made of; False if it cannot be."""
        try:
            cloud: PredictionCloud = messages.read_prediction(messages.decode(message.type, message.data))
        except MessageError:
            return False
        if cloud.probabilities.shape != self._outputs or not np.isfinite(cloud.probabilities).all():
            return False
        shots = self.sights.at(cloud.t_ns)
        if shots is None:
            return False
        self.prediction = np.round(cloud.probabilities.clip(0, 1) * 255).astype(np.uint8)
        self.prediction_ns, self.shots, self.predicted = cloud.t_ns, shots, True
        self.pasts.offer(cloud.t_ns, self.ground.robot_s(cloud.t_ns), shots, self.prediction)
        return True

    def _show_newest(self, now_s: float) -> None:
        """Without a prediction of late, the newest pictures are shown all the same."""
        age_s = self.heard[topics.PREDICTION].age_s(now_s)
        newest = self.sights.newest()
        if newest is not None and (age_s is None or age_s > self.configuration.transport.stale_s):
            self.shots, self.predicted = newest, False

    def _mind_the_cameras(self, now_s: float) -> None:
        for index, same in enumerate(self.sights.same):
            if same < 2:
                self._frozen_since_s.pop(index, None)
            else:
                self._frozen_since_s.setdefault(index, now_s)

    def _hear(self, message: Received) -> None:
        topic = message.key.split("/", 1)[1]
        try:
            with self.lock:
                self._take_status(topic, message.data)
        except (MessageError, TypeError, KeyError, ValueError):
            return  # of another version of this program, or a stranger's

    def _take_status(self, topic: str, data: bytes) -> None:
        now_s = time.monotonic()
        if topic == topics.LEARNER_STATUS:
            self.learner = status.decode_learner(data)
            self._statuses.append((now_s, self.learner))
            while len(self._statuses) > 2 and now_s - self._statuses[1][0] > _BEFORE_S:
                self._statuses.popleft()
        elif topic == topics.PERCEIVER_STATUS:
            self.perceiver = status.PerceiverStatus(**status.decode(data))
        elif topic == topics.CONTROLLER_STATUS:
            self.controller = status.ControllerStatus(**status.decode(data))
        else:
            self.robot = status.decode_robot(data)
        self.heard_s[topic] = now_s

    def _hear_stop(self, message: Received) -> None:
        try:
            wanted = messages.read_flag(messages.decode(message.type or topics.STOP_TYPE, message.data))
        except MessageError:
            return
        with self.lock:
            self.stopped = wanted

    def _come_or_go(self, agent: str, is_there: bool) -> None:
        with self.lock:
            self.agents[agent] = is_there

    # --- what is made of it

    @property
    def obeyed(self) -> Mapping[str, bool]:
        """Who is told to stop and says whether it does, by name; only who is there."""
        said = {"controller": self.controller, "robot": self.robot}
        return {name: one.stopped for name, one in said.items() if one is not None and self.agents.get(name)}

    def evidence(self, now_s: float) -> Evidence:
        """What the diagnosis rests on."""
        configuration, ground = self.configuration, self.ground
        ages = {name: heard.age_s(now_s) for name, heard in self.heard.items()}
        targets, rule = configuration.targets.build().poses, configuration.labels.rule()
        distance_m = np.hypot(targets[:, 0], targets[:, 1])
        before = self._statuses[0][1] if len(self._statuses) > 1 else None
        misses = ground.misses() if _stuck(before, self.learner) else Misses(None, None)
        events = configuration.event_topics
        # One that speaks at changes alone is not missed once it has spoken.
        missed = ages | {name: None if ages[name] is None else 0.0 for name in events}
        camera, ranges = _worst(ages, self._cameras), _worst(missed, configuration.range_topics)
        frozen = min(self._frozen_since_s, key=self._frozen_since_s.__getitem__, default=None)
        learner_s = self.heard_s.get(topics.LEARNER_STATUS)
        perceiving = self.perceiver is not None and self.agents.get("perceiver", False)
        window = self.window
        return Evidence(
            watched_s=now_s - self._began_s,
            odometry_s=ages[configuration.odometry.topic],
            camera_s=camera[1],
            range_s=ranges[1],
            names=(configuration.odometry.topic, camera[0], ranges[0]),
            at_changes=ranges[0] in events,
            useless=self._useless(now_s),
            camera_says=self._camera_says,
            learner_s=None if learner_s is None else now_s - learner_s,
            learner=self.learner,
            before=before,
            predicting=self.perceiver.version if perceiving and self.perceiver is not None else None,
            stopped=self.stopped or any(self.obeyed.values()),
            frozen_s=0.0 if frozen is None else now_s - self._frozen_since_s[frozen],
            frozen=self._cameras[frozen or 0],
            moved_m=ground.moved_m(_MOVED_WITHIN_S),
            window_s=rule.window_s,
            drift=rule.window == "drift",
            gate_m=rule.gate_m,
            back_s=None if window is None else window.back_s,
            reached_m=None if window is None else window.reached_m,
            nearest_m=float(distance_m.min()),
            farthest_m=float(distance_m.max()),
            missed_m=misses.distance_m,
            turned_rad=misses.turned_rad,
            tolerance_m=rule.position_tolerance_m,
            tolerance_rad=rule.heading_tolerance_rad,
            warmup_frames=configuration.training.warmup_frames,
            steps_per_second=configuration.training.steps_per_second,
        )

    @property
    def _camera_says(self) -> str:
        """What a Thymio says of its camera, if that is not well."""
        said = self.robot.camera if isinstance(self.robot, status.ThymioStatus) else ""
        return "" if said in (status.CAMERA_LIVE, status.CAMERA_NONE) else said

    def _useless(self, now_s: float) -> dict[str, str]:
        """Topics on which something comes, and for a while nothing of use: by cause, with what is wrong."""
        configuration = self.configuration
        causes = dict.fromkeys(self._cameras, "camera unusable") | {configuration.odometry.topic: "odometry unusable"}
        steady = [name for name in configuration.range_topics if name not in configuration.event_topics]
        causes = dict.fromkeys(steady, "short range unusable") | causes
        found: dict[str, str] = {}
        for name, cause in causes.items():
            age_s = self.heard[name].age_s(now_s)
            used_s = self._used_s.get(name, self._began_s)
            if age_s is not None and age_s < SILENT_S < now_s - used_s:
                relative = topics.relative_topic(configuration.robot.name, name)
                wrong = {what: count for what, count in self._intake.drops.items() if what.startswith(f"{relative}:")}
                found[cause] = max(wrong, key=wrong.__getitem__, default=f"{name}: {_UNREAD[name in self._cameras]}")
        return found


def _stuck(before: LearnerStatus | None, now: LearnerStatus | None) -> bool:
    """Has no frame got its first label of late?"""
    return before is not None and now is not None and now.labelled == before.labelled


def _worst(ages: Mapping[str, float | None], names: list[str]) -> tuple[str, float | None]:
    """Which of the topics has been silent the longest, and for how long; None: it never came."""
    longest_s = {name: math.inf if (age_s := ages[name]) is None else age_s for name in names}
    silent = max(names, key=longest_s.__getitem__)
    return silent, ages[silent]
