"""Five floors in a row, then the first again: what one teaches about the others, what is forgotten, what is noticed.

Transfer is measured as by Lopez-Paz and Ranzato (Gradient Episodic Memory, NeurIPS 2017, section 3): from the matrix
`R[i, j]`, the AUC on floor j after stage i.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from agents.experiments.curves import values
from agents.experiments.drives import Drive
from agents.experiments.findings import Claim, Table
from agents.experiments.learning import learning
from agents.experiments.settings import HELD_OUT, changed, configuration_of, robot_of, scenario, with_seed
from agents.experiments.statistics import mean
from agents.experiments.trial import Result, Trial

USUAL, FORGETFUL = "with the memory", "learning from recent frames alone"
_FORMS = {USUAL: {}, FORGETFUL: {"memory.recent_share": 1.0}}
#: An alarm that comes so soon after the floor has changed is one of the change; any other is false.
_NOTICED_S = 120.0


@dataclass(frozen=True)
class Row:
    """How much is run.

    Attributes:
        floors: in order; the first comes once more at the end.
        seeds: of layouts, noise and weights.
        minutes: on each.
        held_out_minutes: of the drive on a held-out layout of each floor.
    """

    floors: Sequence[str]
    seeds: Sequence[int]
    minutes: float
    held_out_minutes: float

    @property
    def stages(self) -> list[str]:
        """The floors as they are lived on."""
        return [*self.floors, self.floors[0]]

    @property
    def changes_s(self) -> list[float]:
        """When the floor changes."""
        return [60 * self.minutes * stage for stage in range(1, len(self.stages))]


def named(row: Row) -> Iterator[tuple[str, Trial]]:
    """Form and trial."""
    usual = configuration_of("thymio")
    robot = robot_of(usual)
    exams = {name: [Drive(robot, scenario(name), HELD_OUT, row.held_out_minutes)] for name in row.floors}
    marks_s = [0.0, *row.changes_s, 60 * row.minutes * len(row.stages)]
    for form, changes in _FORMS.items():
        for seed in row.seeds:
            # Another layout when it comes back: what is known again is the floor, not the room.
            lived = [
                Drive(robot, scenario(name), seed + 100 * (stage == len(row.floors)), row.minutes, "seek")
                for stage, name in enumerate(row.stages)
            ]
            yield form, learning(with_seed(changed(usual, changes), seed), lived, exams, marks_s)


def claims(row: Row, results: Mapping[str, Sequence[Result]]) -> Iterator[Claim]:
    """Transfer, forgetting and alarms of each form; `results` are those of its trials."""
    for form, runs in results.items():
        found = [Transfer.of(matrix(row, run)) for run in runs]
        n = "{} rows of " + f"{len(row.stages)} stages, {row.minutes:g} minutes each"
        yield Claim.median(f"in a row, {form}: forward transfer", [one.forward for one in found], n)
        yield Claim.median(f"in a row, {form}: backward transfer", [one.backward for one in found], n)
        yield Claim.median(f"in a row, {form}: forgotten, mean over floors", [one.forgotten for one in found], n)
        yield Claim.median(f"in a row, {form}: forgotten, worst floor", [one.worst for one in found], n)
        yield Claim.median(f"in a row, {form}: the first floor, met again", [one.again for one in found], n)
    heard = [alarms(run["alarms_s"], row.changes_s, 60 * row.minutes * len(row.stages)) for run in results[USUAL]]
    changes = len(row.changes_s)
    share, interval = mean([len(one.delays_s) / changes for one in heard])
    n = f"{changes * len(heard)} changes in {len(heard)} rows"
    yield Claim("in a row: share of floor changes that are noticed", share, None, interval, n)
    delays = [(delay, number) for number, one in enumerate(heard) for delay in one.delays_s]
    if delays:
        found, rows = zip(*delays, strict=True)
        yield Claim.median("in a row: delay of the alarm [s]", found, "{} alarms", groups=rows)
    yield Claim.median("in a row: false alarms an hour", [one.false_per_hour for one in heard], "{} rows")


def table(row: Row, runs: Sequence[Result]) -> Table:
    """The transfer matrix: medians over runs."""
    middle = np.median([matrix(row, run) for run in runs], axis=0)
    stages = ["before", *(f"after {name}" for name in row.floors), f"after {row.floors[0]} again"]
    rows = [[stage, *(f"{value:.3f}" for value in line)] for stage, line in zip(stages, middle, strict=True)]
    caption = f"Mean AUC at 0 to 25 cm on a held-out layout of each floor; medians over {len(runs)} runs."
    return Table("Five floors in a row: the transfer matrix", caption, ["", *row.floors], rows)


def matrix(row: Row, run: Result) -> NDArray[np.float64]:
    """(stages + 1, floors): the AUC on each floor, first before anything was learned."""
    return np.stack([values([run["marks"]], name)[0] for name in row.floors], axis=1)


@dataclass(frozen=True)
class Transfer:
    """What a matrix says, all in AUC; floors are as many as stages but one.

    Attributes:
        forward: on a floor just before it is lived on, over what random weights see there; mean.
        backward: at the end of the row over when it was lived on; mean over all floors but the last.
        forgotten: best ever less what is left at the end of the row; mean over all floors but the last.
        worst: the same of the floor that lost most.
        again: on the first floor after it was met again, over after its first stage.
    """

    forward: float
    backward: float
    forgotten: float
    worst: float
    again: float

    @classmethod
    def of(cls, seen: NDArray[np.float64]) -> "Transfer":
        """From the AUC before all and after each stage, (floors + 2, floors); NaN where any is.

        >>> Transfer.of(np.array([[0.5, 0.5], [0.8, 0.7], [0.7, 0.9], [0.9, 0.8]])).forgotten.__round__(3)
        0.1
        """
        before, stages = seen[0], seen[1:-1]
        floors = len(stages)
        there = stages[np.arange(floors), np.arange(floors)]
        end = stages[-1, :-1]
        lost = stages[:, :-1].max(0) - end
        ahead = [stages[floor - 1, floor] - before[floor] for floor in range(1, floors)]
        return cls(
            float(np.mean(ahead)),
            float(np.mean(end - there[:-1])),
            float(lost.mean()),
            float(lost.max()),
            float(seen[-1, 0] - there[0]),
        )


@dataclass(frozen=True)
class Heard:
    """Alarms of one run.

    Attributes:
        delays_s: from a change to its first alarm, of those that were noticed.
        false_per_hour: alarms at other times, of robot time without a change just before; None where there is none.
    """

    delays_s: Sequence[float]
    false_per_hour: float | None


def alarms(at_s: Sequence[float], changes_s: Sequence[float], whole_s: float) -> Heard:
    """Tell the alarms of changes from false ones.

    >>> alarms([100.0, 350.0, 360.0], [300.0], 600.0)
    Heard(delays_s=[50.0], false_per_hour=7.5)
    """
    ends_s = [min(change + _NOTICED_S, end) for change, end in pairwise([*changes_s, whole_s])]
    delays = [[at - change for at in at_s if change <= at < end] for change, end in zip(changes_s, ends_s, strict=True)]
    quiet_s = whole_s - (sum(ends_s) - sum(changes_s))
    false = len(at_s) - sum(map(len, delays))
    return Heard([found[0] for found in delays if found], 3600 * false / quiet_s if quiet_s else None)
