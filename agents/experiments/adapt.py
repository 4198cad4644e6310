"""A new floor: warm-started from eight scenarios, with and without the memory, beside frozen and from nothing."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from agents.experiments.curves import Marks, curves, values
from agents.experiments.drives import Drive
from agents.experiments.findings import Claim, Findings, Plot
from agents.experiments.learning import Start, learning
from agents.experiments.settings import HELD_OUT, configuration_of, robot_of, scenario, scenarios, values_of, with_seed
from agents.experiments.trial import Result, Trial

_WARM, _FORGETFUL, _FROZEN, _SCRATCH = "warm start with memory", "warm start, weights alone", "frozen", "from nothing"


@dataclass(frozen=True)
class Size:
    """How much is run: each floor as the new one, with all others as the old ones."""

    floors: Sequence[str]
    seeds: Sequence[int]
    marks_s: Sequence[float]
    old_minutes: float
    old_floors: int
    held_out_minutes: float


FULL = Size(("grass", "tiles", "wood"), (0, 1, 2), (0, 15, 30, 60, 120, 180, 300, 600), 5.0, 8, 5.0)
QUICK = Size(("tiles",), (0,), (0, 15, 30), 0.5, 2, 0.5)


def trials(size: Size) -> list[Trial]:
    """All of them."""
    return [trial for _, trial in _named(size)]


def _named(size: Size) -> Iterator[tuple[str, Trial]]:
    """Form and trial."""
    usual = configuration_of("thymio")
    robot = robot_of(usual)
    for floor in size.floors:
        old = [name for name in scenarios() if name != floor][: size.old_floors]
        exams = {
            "new": [Drive(robot, scenario(floor), HELD_OUT + layout, size.held_out_minutes) for layout in (0, 1)],
            "old": [Drive(robot, scenario(name), HELD_OUT, size.held_out_minutes / 2) for name in old],
        }
        for seed in size.seeds:
            form = with_seed(usual, seed)
            before = [Drive(robot, scenario(name), seed, size.old_minutes) for name in old]
            lived = [Drive(robot, scenario(floor), seed, size.marks_s[-1] / 60)]
            start = Start(values_of(form), before)
            alone = Start(values_of(form), before, memory=False)
            yield _WARM, learning(form, lived, exams, size.marks_s, start=start)
            yield _FORGETFUL, learning(form, lived, exams, size.marks_s, start=alone)
            yield _FROZEN, learning(form, lived, exams, (size.marks_s[0], size.marks_s[-1]), start=start, frozen=True)
            yield _SCRATCH, learning(form, lived, exams, size.marks_s)


def findings(size: Size, results: Sequence[Result]) -> Findings:
    """AUC on the new floor and on the old ones, at each mark."""
    runs: dict[str, list[Marks]] = {}
    for (form, _), result in zip(_named(size), results, strict=True):
        runs.setdefault(form, []).append(result["marks"])
    story = (
        f"A learner lives {size.old_minutes:g} minutes in each of {size.old_floors} scenarios, then moves to a floor "
        f"it never saw ({', '.join(size.floors)}; {len(size.seeds)} seeds each). Mean AUC at 0 to 25 cm on two "
        "held-out layouts of the new floor, and on one of each old floor. Values are medians over runs, intervals "
        "resample runs."
    )
    n = f"{len(runs[_WARM])} runs: {len(size.floors)} floors x {len(size.seeds)} seeds"
    return Findings(
        "adapt: a new floor",
        story,
        list(_claims(size, runs, n)),
        runs,
        [
            Plot("new_floor", curves(runs, "new"), "Median AUC on the new floor by robot minutes"),
            Plot("old_floors", curves(runs, "old"), "Median AUC on the old floors by robot minutes"),
        ],
    )


def _claims(size: Size, runs: dict[str, list[Marks]], n: str) -> Iterator[Claim]:
    new = values(runs[_WARM], "new")
    at = {int(mark_s): column for mark_s, column in zip(size.marks_s, new.T, strict=True)}
    yield Claim.median("new floor, at once", at[0], n, 0.87)
    if 180 in at:
        yield Claim.median("new floor, after 3 minutes", at[180], n, 0.91)
    yield Claim.median("new floor, after the last mark", new[:, -1], n)
    yield Claim.median(
        "deepest fall below the start on the new floor", (new[:, :1] - new).max(1), n, 0.02, at_most=True
    )
    for form, bar in ((_WARM, 0.005), (_FORGETFUL, None)):
        old = values(runs[form], "old")
        yield Claim.median(f"lost on the old floors, {form}", old[:, 0] - old[:, -1], n, bar, at_most=True)
    for form in (_FORGETFUL, _FROZEN, _SCRATCH):
        yield Claim.median(f"new floor at the end, {form}", values(runs[form], "new")[:, -1], n)
