"""Which window is best for a robot? What each gives, and what its labels are worth, told by the robot's own data.

A longer window knows more labels, and trusts odometry for longer. Of N labels whose bits correlate with the truth by
r, a learner has as much as of N r^2 faultless ones (the attenuation of test theory; for balanced classes and errors it
is the (1 - 2 error)^2 of Angluin and Laird, Learning from noisy examples, 1988). The robot does not know the truth, but
it knows what it felt when it came back to a place after so long (`replay.sightings`): that correlation, by age, stands
for r.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from replay.poses import Floats
from replay.resolution import Labels
from replay.rule import LabelRule
from replay.sightings import Sightings

Counts = NDArray[np.int64]

WINDOWS_S = (1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0, 120.0)
#: Eleven days: longer than any drive, and far from the end of what nanoseconds in 64 bits can say.
UNLIMITED_S = 1e6
#: Ages of labels are told apart as the windows are.
AGES_S = np.array([0.0, *WINDOWS_S, UNLIMITED_S])
UNLIMITED, DRIFT = "unlimited", "drift"
#: A window is as good as the best if its labels are worth at least this share; of those the shortest is recommended.
_AS_GOOD = 0.99
#: An age is judged by at least so many bits felt twice, and so many of them 1 the first time.
FEWEST, FEWEST_POSITIVE = 30, 3


class Tally(NamedTuple):
    """Labels, counted.

    Attributes:
        frames: with a pose.
        known: labels.
        positive: of them.
        ages: (A,) int64, known labels by their age, between `AGES_S`.
    """

    frames: int
    known: int
    positive: int
    ages: Counts

    @staticmethod
    def of(found: Labels, streams: Sequence[Sequence[int]]) -> "Tally":
        """Of one drive."""
        known = found.labels >= 0
        ages = np.zeros(len(AGES_S) - 1, np.int64)
        for stream, members in enumerate(streams):
            count, apart_s = known[:, :, members].sum(-1), found.apart_s[:, stream]
            some = count > 0
            np.add.at(ages, _age(apart_s[some].astype(np.float64)), count[some])
        return Tally(int(found.posed.sum()), int(known.sum()), int((found.labels == 1).sum()), ages)

    @staticmethod
    def together(parts: Sequence["Tally"]) -> "Tally":
        """Of several drives."""
        ages: Counts = np.stack([part.ages for part in parts]).sum(0)
        frames, known = sum(part.frames for part in parts), sum(part.known for part in parts)
        return Tally(frames, known, sum(part.positive for part in parts), ages)

    @property
    def per_frame(self) -> float:
        """Known labels a frame; 0 without a frame."""
        return self.known / max(self.frames, 1)


def rules(rule: LabelRule, longest_s: float = np.inf) -> dict[str, LabelRule]:
    """The windows to compare: name -> rule.

    The fixed ones, ascending; `unlimited`; then `drift` without a limit in time.

    Args:
        rule: its tolerances and gate are kept.
        longest_s: of a drive: no window that long is told from `unlimited`.

    >>> list(rules(LabelRule(0.01), longest_s=4.0))
    ['1 s', '2 s', 'unlimited', 'drift']
    """
    tolerances = rule.position_tolerance_m, rule.heading_tolerance_rad
    fixed = {f"{seconds:g} s": LabelRule(*tolerances, seconds) for seconds in WINDOWS_S if seconds < longest_s}
    return {
        **fixed,
        UNLIMITED: LabelRule(*tolerances, UNLIMITED_S),
        DRIFT: LabelRule(*tolerances, UNLIMITED_S, "drift", rule.gate_m),
    }


def _age(apart_s: Floats) -> Counts:
    """Which of the ages each time is: after one of `AGES_S` and not after the next; what is just now is the first."""
    return np.clip(np.searchsorted(AGES_S, apart_s, "left") - 1, 0, len(AGES_S) - 2)


def felt_twice(seen: Sightings, gate_m: float | None = None) -> Counts:
    """(A, 2, 2) int64: bits by the age between, what was felt first, and what again; with a gate, pairs known to it."""
    age = _age(seen.apart_s)
    known = (seen.first >= 0) & (seen.again >= 0)
    if gate_m is not None:
        known &= (seen.deviation_m <= gate_m)[:, None]
    pair, sensor = np.nonzero(known)
    counts = np.zeros((len(AGES_S) - 1, 2, 2), np.int64)
    np.add.at(counts, (age[pair], seen.first[pair, sensor], seen.again[pair, sensor]), 1)
    return counts


def agreement(counts: Counts, rule: LabelRule) -> tuple[float | None, int]:
    """Share of the bits felt twice within a rule's window that agree, and of how many; None of none."""
    within = counts[AGES_S[1:] <= rule.window_s].sum(0)
    total = int(within.sum())
    return (float(within[0, 0] + within[1, 1]) / total if total else None), total


def correlations(counts: Counts) -> Floats | None:
    """(A,) float64: how what was felt first and again correlate, by age; None if no age has enough bits.

    Odometry only forgets: a correlation that rises with age is chance, and smoothed away (isotonic regression). An age
    without enough bits is as the younger one, or as the first that has.

    >>> correlations(np.tile(np.diag([90, 10]), (9, 1, 1)))
    array([1., 1., 1., 1., 1., 1., 1., 1., 1.])
    """
    from scipy.optimize import isotonic_regression

    enough = (counts.sum((1, 2)) >= FEWEST) & (counts[:, 1].sum(1) >= FEWEST_POSITIVE)
    enough &= (counts.sum(1) > 0).all(1) & (counts.sum(2) > 0).all(1)
    if not enough.any():
        return None
    some = counts[enough].astype(np.float64)
    (zeros, lost), (came, ones) = some.transpose(1, 2, 0)
    margins = (zeros + lost) * (came + ones) * (zeros + came) * (lost + ones)
    found = np.maximum((zeros * ones - lost * came) / np.sqrt(margins), 0.0)
    smooth = isotonic_regression(found, weights=some.sum((1, 2)), increasing=False).x
    return smooth[np.maximum(np.cumsum(enough) - 1, 0)]


def worth(tally: Tally, by_age: Floats) -> float:
    """How many faultless labels a frame the known ones are worth, if those of an age correlate so with the truth.

    A learner cannot tell the good from the bad, so the correlation of all is the mean of theirs.
    """
    total = int(tally.ages.sum())
    return float((tally.ages * by_age).sum()) ** 2 / total / max(tally.frames, 1) if total else 0.0


def recommended(worths: Mapping[str, float]) -> str:
    """The shortest of the fixed windows, ascending, that is as good as the best: a frame waits no longer than it must.

    >>> recommended({"1 s": 40.0, "2 s": 55.0, "5 s": 55.2, "unlimited": 50.0})
    '2 s'
    """
    best = max(worths.values())
    return next(name for name, value in worths.items() if value >= _AS_GOOD * best)
