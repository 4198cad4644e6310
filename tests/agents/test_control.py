"""What the study of driving makes of its numbers."""

import pytest

from agents.experiments import control
from agents.experiments.statistics import mean, median

SIZE = control.Size(("grass", "tiles", "wood"), (0, 1, 2), (0, 10), 10.0, ("grass",), 2, 24.0, 1.0)
MINUTE = {"known_labels": 100, "positive_labels": 10, "collisions": 1}


def results(learned: list[int]) -> list[dict]:
    """Nine judged runs of each way: so many collisions after ten minutes of learning; and lives that are all alike."""
    found: list[dict] = []
    for collisions in learned:
        counts = (20, collisions, 0, 0, 60)  # untrained, learned, oracle, reflex, blind
        found += [{"collisions": count, "metres": 20.0} for count in counts]
    life = {"minutes": [MINUTE, MINUTE], "before": {"far": 0.9}, "after": {"far": 0.9}}
    return found + [life] * (len(control._LIVES) * 3)


def claims(learned: list[int]) -> dict:
    return {claim.what: claim for claim in control.findings(SIZE, results(learned)).claims}


def test_a_few_runs_with_many_collisions_are_not_hidden_by_those_without() -> None:
    found = claims([0] * 6 + [8, 1, 17])
    beside_reflex = found["collisions in 10 min after the longest learning, less the reflex's, mean"]
    assert beside_reflex.value == pytest.approx(26 / 9)
    assert beside_reflex.holds is False
    assert beside_reflex.interval is not None
    assert beside_reflex.interval[1] > 2
    beside_random = found["collisions after the longest learning, as a share of random driving's"]
    assert beside_random.value == pytest.approx(26 / (9 * 60))
    assert found["collisions in 100 m, avoiding after 10 min of learning"].value == pytest.approx(100 * 26 / 180)


def test_none_at_all_is_no_more_than_the_reflex_makes() -> None:
    assert claims([0] * 9)["collisions in 10 min after the longest learning, less the reflex's, mean"].holds is True


def test_a_mean_needs_values() -> None:
    with pytest.raises(ValueError, match="at least one"):
        mean([])


def test_runs_of_a_group_are_drawn_together() -> None:
    values, groups = [0.1, 0.1, 0.1, 0.9, 0.9, 0.9], ["wood"] * 3 + ["tiles"] * 3
    middle, (low, high) = median(values, groups)
    assert (middle, low, high) == (0.5, 0.1, 0.9)
    assert median(values, range(6)) == median(values)
    with pytest.raises(ValueError, match="a group for each of 6"):
        median(values, groups[:5])
