"""What labels are worth, and which window that recommends."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from llrp_online import figures, windows
from llrp_online.figures import WindowPanel
from llrp_online.windows import AGES_S, DRIFT, UNLIMITED, WINDOWS_S, Tally
from replay.resolution import Labels
from replay.rule import LabelRule
from replay.sightings import Sightings

AGES = len(AGES_S) - 1
COUNTS = st.lists(st.integers(0, 200), min_size=4 * AGES, max_size=4 * AGES).map(
    lambda numbers: np.array(numbers).reshape(AGES, 2, 2)
)


def seen(apart_s, first, again, deviation_m=0.0):
    rows = len(apart_s)
    bits = [np.array(values, np.int8).reshape(rows, -1) for values in (first, again)]
    return Sightings(np.array(apart_s, np.float64), np.full(rows, deviation_m), *bits)


def test_a_label_is_as_old_as_the_shortest_window_that_has_it():
    ages_s = np.array([0.0, 0.5, 1.0, 1.0001, 5.0, 121.0, np.nan], np.float32)
    labels = np.array([0, 1, 1, 0, 1, 0, -1], np.int8)
    found = Labels(labels[:, None, None], np.ones((7, 1, 1), np.float32), np.ones(7, bool), ages_s[:, None, None])
    tally = Tally.of(found, [[0]])
    assert (tally.frames, tally.known, tally.positive) == (7, 6, 3)
    assert tally.ages.tolist() == [3, 1, 1, 0, 0, 0, 0, 0, 1]
    twice = Tally.together([tally, tally])
    assert (twice.frames, twice.known, twice.positive, twice.ages.tolist()) == (14, 12, 6, (2 * tally.ages).tolist())


def test_what_was_felt_twice_is_counted_by_age_and_gate():
    found = seen([0.5, 2.0, 300.0], [[1, -1], [0, 1], [0, 0]], [[1, 1], [1, 1], [0, 0]], deviation_m=0.02)
    counts = windows.felt_twice(found)
    assert counts[0].tolist() == [[0, 0], [0, 1]]
    assert counts[1].tolist() == [[0, 1], [0, 1]]
    assert counts[-1].tolist() == [[2, 0], [0, 0]]
    assert windows.felt_twice(found, gate_m=0.02).tolist() == counts.tolist()
    assert not windows.felt_twice(found, gate_m=0.019).any()


def test_agreement_is_of_the_window_alone():
    counts = windows.felt_twice(seen([0.5, 2.0, 300.0], [1, 0, 0], [1, 1, 0]))
    assert windows.agreement(counts, LabelRule(0.1, window_s=1.0)) == (1.0, 1)
    assert windows.agreement(counts, LabelRule(0.1, window_s=2.0)) == (0.5, 2)
    assert windows.agreement(counts, LabelRule(0.1, window_s=windows.UNLIMITED_S)) == (pytest.approx(2 / 3), 3)
    assert windows.agreement(0 * counts, LabelRule(0.1)) == (None, 0)


@given(COUNTS)
def test_odometry_only_forgets(counts):
    by_age = windows.correlations(counts)
    if by_age is not None:
        assert ((by_age >= 0) & (by_age <= 1 + 1e-9)).all()
        assert (np.diff(by_age) <= 1e-9).all()


def test_chance_is_worth_nothing_and_few_bits_tell_nothing():
    chance = np.tile(np.array([[81, 9], [9, 1]]), (AGES, 1, 1))
    assert windows.correlations(chance).tolist() == pytest.approx([0.0] * AGES, abs=1e-12)
    few = np.zeros((AGES, 2, 2), np.int64)
    few[0] = [[20, 0], [0, 5]]
    assert windows.correlations(few) is None
    never = np.zeros((AGES, 2, 2), np.int64)
    never[:, 0, 0] = 1000
    assert windows.correlations(never) is None


@given(st.lists(st.integers(0, 1000), min_size=AGES, max_size=AGES), st.floats(0.0, 1.0))
def test_labels_of_one_correlation_are_worth_its_square_each(ages, correlation):
    tally = Tally(10, sum(ages), 0, np.array(ages))
    worth = windows.worth(tally, np.full(AGES, correlation))
    assert worth == pytest.approx(sum(ages) / 10 * correlation**2)


@given(st.integers(1, 1000), st.floats(0.2, 1.0))
def test_labels_add_worth_if_they_correlate_more_than_half_as_well(few, correlation):
    """d(worth)/dN = r(2 r_new - r): so a few labels pay above half the correlation, and cost below it."""
    before, after = np.zeros((2, AGES), np.int64)
    before[0] = after[0] = 1_000_000
    after[1] = few
    by_age = np.full(AGES, correlation)
    alone = windows.worth(Tally(1, 0, 0, before), by_age)
    for share in (0.55, 0.45):
        by_age[1] = share * correlation
        assert (windows.worth(Tally(1, 0, 0, after), by_age) > alone) == (share > 0.5)


def test_the_windows_compared_keep_tolerances_and_leave_out_what_no_drive_tells_apart():
    rule = LabelRule(0.02, 0.3, 7.0, "fixed", 0.05)
    compared = windows.rules(rule, longest_s=25.0)
    assert list(compared) == ["1 s", "2 s", "5 s", "10 s", "20 s", UNLIMITED, DRIFT]
    assert len(windows.rules(rule)) == len(WINDOWS_S) + 2
    assert all((r.position_tolerance_m, r.heading_tolerance_rad) == (0.02, 0.3) for r in compared.values())
    assert [r.window for r in compared.values()] == ["fixed"] * 6 + ["drift"]
    assert compared[DRIFT].gate_m == 0.05
    assert all(r.window_ns < 2**62 for r in compared.values())


def test_both_curves_are_drawn_and_the_recommended_window_is_shaded():
    drawn = WindowPanel("r", ["1 s", "2 s"], [3.0, 4.0], [0.99, None], (4.0, 0.98), 1)
    bare = WindowPanel("s", ["1 s", "2 s"], [0.0, 0.0], [None, None], (0.0, None), None)
    figure = figures.windows([drawn, bare], "agreeing")
    left, right = figure.axes[:2]
    assert left.get_lines()[0].get_ydata().tolist() == [3.0, 4.0]
    assert right.get_lines()[0].get_ydata()[0] == pytest.approx(99.0)
    assert [tick.get_text() for tick in left.get_xticklabels()] == ["1", "2", "drift"]
    assert [len(axes.patches) for axes in (left, figure.axes[2])] == [1, 0]
    assert len(figures.png(figure)) > 1000
