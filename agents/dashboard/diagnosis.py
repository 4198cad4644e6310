"""Why is it not learning? From what can be seen from outside to the cause, in words, and what to do about it.

Pure: evidence in, findings out, the worst first. A cause that explains others is told alone: who has no odometry need
not hear that the window might be too short.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Literal

from llrp_online.status import LearnerStatus

Grade = Literal["stops", "slows", "note", "fine"]
_GRADES: tuple[Grade, ...] = ("stops", "slows", "note", "fine")
#: A topic or an agent that has said nothing for so long is silent.
SILENT_S = 2.0
#: The dashboard itself has to have looked for so long before silence means something.
_PATIENCE_S = 5.0
_SENT = "Is it sent, and under this name? llrp check --live --config C.toml."
_FROZEN_S = 2.0
_STILL_M = 0.02
#: Between two statuses: fewer new frames tell nothing.
_FEW_FRAMES = 20
#: A target that none of so many frames has a label for is out of reach.
_MANY_FRAMES = 500
#: Of the steps due, let go: more is a learner that cannot keep up.
_LET_GO_SHARE = 0.1
_LONG_BACKLOG = 500
#: Weights offered and rejected since the earlier status, with none that passed.
_REJECTED = 5
#: Of all known labels, fewer than this share in a class is next to one class only.
_FEWEST_CLASS = 0.002


@dataclass(frozen=True)
class Evidence:
    """What can be seen from outside.

    Attributes:
        watched_s: how long the dashboard has looked on.
        odometry_s: since the last odometry, wall time; None: it never came.
        camera_s: the same of the camera that has been silent the longest.
        range_s: the same of the range topic that has been silent the longest.
        names: topics of odometry, camera and range, for words.
        at_changes: that range topic speaks only when something changes.
        useless: of what comes and cannot be used, cause -> the topic and what is wrong with it.
        camera_says: what the robot itself says of its camera; empty if that is well, or nothing is said.
        learner_s: since the learner's last status; None: never.
        learner: its newest status.
        before: one of about half a minute earlier; None before there is one.
        predicting: version of the weights that the perceiver predicts with; None: there is no perceiver or it has none.
        stopped: a person's stop holds.
        frozen_s: for so long each picture of a camera has been its last one again.
        frozen: that camera's topic.
        moved_m: the way driven in the last ten seconds of the robot's time.
        window_s: longest time between frame and reading.
        drift: the window closes where the pose is no longer known.
        gate_m: to within what.
        back_s: how far back the window reaches now; None without odometry.
        reached_m: farthest the robot got from where it was within the window; None without odometry.
        nearest_m: distance of the nearest target.
        farthest_m: of the farthest.
        missed_m: how far readings were from targets, of those that came nearest; None where there is too little.
        turned_rad: how far their heading was off, of those near enough; None likewise.
        tolerance_m: how far a reading may be.
        tolerance_rad: how far its heading may be off; None: that does not matter.
        warmup_frames: labelled frames before the first step.
        steps_per_second: due.
    """

    watched_s: float = 60.0
    odometry_s: float | None = 0.0
    camera_s: float | None = 0.0
    range_s: float | None = 0.0
    names: tuple[str, str, str] = ("odom", "camera", "range")
    at_changes: bool = False
    useless: Mapping[str, str] = field(default_factory=dict[str, str])
    camera_says: str = ""
    learner_s: float | None = 0.0
    learner: LearnerStatus | None = None
    before: LearnerStatus | None = None
    predicting: int | None = 1
    stopped: bool = False
    frozen_s: float = 0.0
    frozen: str = "camera"
    moved_m: float = 1.0
    window_s: float = 30.0
    drift: bool = False
    gate_m: float = 0.01
    back_s: float | None = 30.0
    reached_m: float | None = 1.0
    nearest_m: float = 0.0
    farthest_m: float = 0.3
    missed_m: float | None = 0.0
    turned_rad: float | None = 0.0
    tolerance_m: float = 0.01
    tolerance_rad: float | None = 0.05
    warmup_frames: int = 32
    steps_per_second: float = 5.0


@dataclass(frozen=True)
class Finding:
    """A cause.

    Attributes:
        cause: one word for programs.
        grade: it stops learning, slows it, is a note, or all is fine.
        what: is the matter.
        do: about it.
    """

    cause: str
    grade: Grade
    what: str
    do: str


def diagnose(seen: Evidence) -> list[Finding]:
    """What keeps the robot from learning, the worst first; that all is fine, if nothing does.

    >>> diagnose(Evidence(odometry_s=None))[0].cause
    'odometry missing'
    """
    found = list(_agents(seen)) + list(_inputs(seen))
    if not any(finding.grade == "stops" for finding in found):
        found += _labels(seen)
        found += _training(seen)
    if not any(finding.grade in ("stops", "slows") for finding in found):
        found.append(_fine(seen))
    return sorted(found, key=lambda finding: _GRADES.index(finding.grade))


def _agents(seen: Evidence) -> Iterator[Finding]:
    if seen.learner_s is None and seen.watched_s > _PATIENCE_S:
        yield Finding(
            "no learner",
            "stops",
            "No learner has said anything.",
            "Start one: llrp learn --config C.toml --output RUN, configuration and endpoint as this page has them.",
        )
    elif seen.learner_s is not None and seen.learner_s > _PATIENCE_S:
        yield Finding(
            "learner silent",
            "stops",
            f"The learner has been silent for {seen.learner_s:.0f} s; it says something every second.",
            "See its terminal for an error. A save of a large memory may take some seconds; else start it anew with "
            "--resume RUN/checkpoint.",
        )
    if seen.learner is not None and seen.learner.paused:
        yield Finding("paused", "stops", "Learning is paused.", "Press Resume.")
    if seen.stopped:
        yield Finding(
            "stopped",
            "slows",
            "The robot stands still because somebody pressed Stop, so it meets nothing new.",
            "Press Release when the way is clear.",
        )
    learned = seen.learner is not None and seen.learner.version is not None
    if learned and seen.predicting is None and seen.watched_s > _PATIENCE_S:
        yield Finding(
            "no predictions",
            "note",
            "There are weights, but nobody predicts with them.",
            "Start a perceiver: llrp perceive --config C.toml.",
        )


def _inputs(seen: Evidence) -> Iterator[Finding]:
    spoken = f"It speaks only when something changes: press each bumper once. If that does not help: {_SENT}"
    says = f" The robot says: camera {seen.camera_says}." if seen.camera_says else ""
    odometry, camera, short_range = seen.names
    kinds = (
        ("odometry missing", seen.odometry_s, odometry, "Without poses no reading can be brought to a frame.", _SENT),
        ("camera missing", seen.camera_s, camera, f"Without pictures there is nothing to label.{says}", _SENT),
        (
            "short range missing",
            seen.range_s,
            short_range,
            "Without readings there is nothing to learn from.",
            spoken if seen.at_changes else _SENT,
        ),
    )
    for cause, age_s, name, why, never in kinds:
        if age_s is None and seen.watched_s > _PATIENCE_S:
            yield Finding(cause, "stops", f"Nothing has come on {name}. {why}", never)
        elif age_s is not None and age_s > SILENT_S:
            what = f"{name} has been silent for {age_s:.0f} s. {why}"
            yield Finding(cause, "stops", what, "Is the robot on, its driver running, the link up?")
    for cause, sentence in seen.useless.items():
        yield Finding(
            cause,
            "stops",
            f"What comes cannot be used: {sentence}.",
            "Mend the driver, or the topic and its type in the configuration; llrp check --live names all that is "
            "wrong.",
        )
    if seen.frozen_s > _FROZEN_S and seen.moved_m > _STILL_M:
        yield Finding(
            "camera frozen",
            "stops",
            f"{seen.frozen} has sent the same picture for {seen.frozen_s:.0f} s, while the robot drives.",
            "Start the camera's driver anew; until then wrong labels are learned, so pause learning.",
        )


def _labels(seen: Evidence) -> Iterator[Finding]:
    now, before = seen.learner, seen.before
    if now is None:
        return
    fresh = before is not None and now.frames - before.frames >= _FEW_FRAMES
    if before is not None and fresh and now.labelled == before.labelled and now.remembered <= before.remembered:
        yield _no_labels(seen)
    known, positives = sum(now.known), sum(now.positives)
    never = known > 0 and 0 in now.known and now.labelled >= _MANY_FRAMES
    if never and seen.reached_m is not None and seen.reached_m + seen.tolerance_m < seen.farthest_m:
        yield _short_window(seen, "note")
    fewer = min(positives, known - positives)
    if known and fewer < _FEWEST_CLASS * known:
        lacking = "felt nothing" if positives > known - positives else "felt something"
        yield Finding(
            "one class only",
            "stops" if fewer == 0 else "slows",
            f"Of {known} known labels {fewer} say that a sensor {lacking}. From one class nothing can be told apart.",
            "Let it drive where there are both, obstacles and free floor; or see with llrp check if `below` or `above` "
            "of the sensors fits their units.",
        )
    if now.labelled < seen.warmup_frames and now.steps == 0 and now.labelled > 0:
        yield Finding(
            "warming up",
            "note",
            f"{now.labelled} frames have a label; training begins at {seen.warmup_frames} (training.warmup_frames).",
            "Wait a moment.",
        )


def _no_labels(seen: Evidence) -> Finding:
    """No frame has got its first label since the earlier status: the one cause that explains it best."""
    if seen.moved_m < _STILL_M:
        return Finding(
            "standing still",
            "stops",
            "No new labels: the robot hardly moves.",
            "Drive it: llrp control --behaviour explore. A place is labelled when the robot comes there.",
        )
    if seen.reached_m is not None and seen.reached_m + seen.tolerance_m < seen.nearest_m:
        return _short_window(seen, "stops")
    if seen.missed_m is not None and seen.missed_m > seen.tolerance_m:
        return Finding(
            "tolerance too tight",
            "stops",
            f"No new labels: readings pass the targets at {100 * seen.missed_m:.1f} cm, and "
            f"{100 * seen.tolerance_m:.1f} cm are allowed.",
            "Raise labels.position_tolerance_m above that, send readings more often, or drive slower.",
        )
    if seen.tolerance_rad is not None and seen.turned_rad is not None and seen.turned_rad > seen.tolerance_rad:
        return Finding(
            "heading tolerance too tight",
            "stops",
            f"No new labels: readings are near enough but turned by {seen.turned_rad:.2f} rad, and "
            f"{seen.tolerance_rad:.2f} rad are allowed.",
            "Raise labels.heading_tolerance_rad, or leave it out where the heading does not matter.",
        )
    return Finding(
        "no labels",
        "stops",
        "No new labels, though odometry, camera and readings come.",
        "Do their clocks agree? llrp check --live compares them, and counts what was dropped.",
    )


def _short_window(seen: Evidence, grade: Grade) -> Finding:
    reached_m, far_m = seen.reached_m or 0.0, seen.nearest_m if grade == "stops" else seen.farthest_m
    which = "the nearest target is" if grade == "stops" else "targets go on until"
    if seen.drift:
        span = f"{seen.back_s or 0.0:.0f} s back, until the pose is known to {100 * seen.gate_m:.1f} cm only"
        do = "Raise labels.gate_m, or tell how good odometry really is ([odometry] noise); see llrp window."
    else:
        span = f"labels.window_s = {seen.window_s:g} s"
        do = "Raise labels.window_s if odometry allows (llrp window tells), or drive faster and straighter."
    return Finding(
        "window too short",
        grade,
        f"Within the window ({span}) the robot gets {reached_m:.2f} m from where it was; {which} {far_m:.2f} m away.",
        do,
    )


def _training(seen: Evidence) -> Iterator[Finding]:
    now, before = seen.learner, seen.before
    if now is None or before is None:
        return
    lived_s, steps = now.robot_s - before.robot_s, now.steps - before.steps
    let_go = now.let_go - before.let_go
    if lived_s > 1.0 and let_go > _LET_GO_SHARE * lived_s * seen.steps_per_second:
        yield Finding(
            "throttled",
            "slows",
            f"In the last {lived_s:.0f} s of the robot's time {steps} training steps were taken and {let_go:.0f} let "
            "go: the learner cannot keep up.",
            "Give it more of a core (training.core_share, a lighter load beside it), lower training.steps_per_second "
            "or training.batch, or play slower.",
        )
    if now.backlog > _LONG_BACKLOG:
        yield Finding(
            "backlog",
            "slows",
            f"{now.backlog} messages wait for the learner.",
            "The machine is too busy; what waits is taken in first, and training waits meanwhile.",
        )
    rejected = now.rejected - before.rejected
    if rejected >= _REJECTED and now.version == before.version:
        yield Finding(
            "rejected by the gate",
            "slows",
            f"The last {rejected} weights were judged worse on held-out frames than version {now.version}, and kept "
            "back.",
            "If the world has just changed, wait: the held-out frames change with it. If not, look for wrong labels "
            "(click a past frame), or roll back.",
        )


def _fine(seen: Evidence) -> Finding:
    now = seen.learner
    if now is None or now.version is None:
        return Finding("waiting", "note", "Nothing is wrong so far; there are no weights yet.", "Wait a moment.")
    scores = [band.auc for band in now.bands if band.auc is not None]
    auc = (
        f" Prequential AUC by distance, near to far: {', '.join(f'{score:.2f}' for score in scores)}." if scores else ""
    )
    return Finding("learning", "fine", f"It is learning: version {now.version}, {now.steps} steps.{auc}", "")
