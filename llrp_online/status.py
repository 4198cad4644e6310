"""What the learner says of itself: a plain value, for those who watch without having PyTorch."""

from dataclasses import dataclass, field

from llrp_online.prequential import Band

HAIR_S = 0.5


@dataclass(frozen=True)
class LearnerStatus:
    """What the learner says of itself.

    Attributes:
        robot_s: how long the robot has lived, by its sensors.
        frames: frames taken in.
        waiting: frames whose window is open.
        labelled: frames with at least one known label.
        known: known labels of all closed frames and `positives` of them, by target.
        remembered: frames in the buffer.
        steps: training steps.
        let_go: steps owed but let go, the learner being too slow.
        loss: of the newest step; None before the first.
        version: of the newest weights; None before the first.
        version_age_s: robot time since they were published.
        rejected: how often new weights were judged worse.
        bands: prequential score by distance over the newest frames.
        drift_events: how many so far.
        drops: what could not be used.
        paused: told to.
        sizes: rows of every ring and memory, and the bytes of the pictures waiting, by name.
        backlog: messages that have come and are not taken in yet.
        driven_m: how far it has driven, by its odometry.
        kept: versions that it can roll back to, oldest first.
    """

    robot_s: float
    frames: int
    waiting: int
    labelled: int
    known: list[int]
    positives: list[int]
    remembered: int
    steps: int
    let_go: float
    loss: float | None
    version: int | None
    version_age_s: float | None
    rejected: int
    bands: list[Band]
    drift_events: int
    drops: dict[str, int]
    paused: bool
    sizes: dict[str, int] = field(default_factory=dict[str, int])
    backlog: int = 0
    driven_m: float = 0.0
    kept: list[int] = field(default_factory=list[int])


def whole_minutes(robot_s: float) -> int:
    """Whole robot minutes; the last tick of a drive of ten minutes is a hair short of them, and counts.

    >>> whole_minutes(59.9), whole_minutes(59.0)
    (1, 0)
    """
    return int((robot_s + HAIR_S) // 60)
