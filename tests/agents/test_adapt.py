"""What the studies of a new floor and of the paper's experiment make of their numbers."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.experiments import adapt, adapt_row, crossval
from agents.experiments.adapt_row import Row, Transfer, alarms
from agents.experiments.training import Example
from llrp_online.metrics import Score

ROW = Row(("a", "b", "c"), (0,), 5.0, 1.0)


@given(st.integers(2, 5), st.floats(0.0, 1.0))
def test_who_always_sees_alike_transfers_and_forgets_nothing(floors: int, auc: float) -> None:
    found = Transfer.of(np.full((floors + 2, floors), auc))
    assert found == Transfer(0.0, 0.0, 0.0, 0.0, 0.0)


def test_transfer_is_read_off_the_matrix() -> None:
    # before, after a, after b, after c, after a again; floors a, b, c
    seen = np.array([[0.5, 0.5, 0.5], [0.9, 0.6, 0.7], [0.8, 0.9, 0.8], [0.7, 0.85, 0.95], [0.88, 0.8, 0.9]])
    found = Transfer.of(seen)
    assert found.forward == pytest.approx((0.1 + 0.3) / 2)
    assert found.backward == pytest.approx(((0.7 - 0.9) + (0.85 - 0.9)) / 2)
    assert found.forgotten == pytest.approx((0.2 + 0.05) / 2)
    assert found.worst == pytest.approx(0.2)
    assert found.again == pytest.approx(-0.02)


def test_an_undefined_auc_makes_what_rests_on_it_undefined() -> None:
    seen = np.full((5, 3), 0.8)
    seen[2, 1] = np.nan
    assert np.isnan(Transfer.of(seen).forgotten)


def test_a_row_ends_where_it_began() -> None:
    assert ROW.stages == ["a", "b", "c", "a"]
    assert ROW.changes_s == [300.0, 600.0, 900.0]


@given(st.lists(st.floats(0.0, 1199.0), max_size=20))
def test_every_alarm_is_of_a_change_or_false(at_s: list[float]) -> None:
    heard = alarms(sorted(at_s), ROW.changes_s, 1200.0)
    of_changes = sum(any(0 <= at - change < 120.0 for change in ROW.changes_s) for at in at_s)
    quiet_hours = (1200.0 - 3 * 120.0) / 3600
    assert heard.false_per_hour == pytest.approx((len(at_s) - of_changes) / quiet_hours)
    assert len(heard.delays_s) <= len(ROW.changes_s)
    assert all(0 <= delay < 120.0 for delay in heard.delays_s)


def test_without_a_quiet_moment_there_is_no_rate() -> None:
    assert alarms([], [0.0, 60.0], 120.0).false_per_hour is None


def test_the_new_floors_are_not_among_the_old() -> None:
    assert not set(adapt.FULL.new) & set(adapt.FULL.old)
    assert len(adapt.FULL.old) == 8
    assert len(adapt.FULL.row.floors) == 5


def test_every_trial_of_a_row_is_tried_before_and_after_each_stage() -> None:
    for _, trial in adapt_row.named(ROW_OF_FLOORS):
        assert trial.parameters["marks_s"] == [0.0, 60.0, 120.0, 180.0]
        first, *_, last = trial.parameters["lived"]
        assert first["scenario"] == last["scenario"]
        assert first["seed"] != last["seed"]


ROW_OF_FLOORS = Row(("tiles", "wood"), (0, 1), 1.0, 0.5)


def test_an_example_survives_json() -> None:
    random = np.random.default_rng(0)
    example = Example(
        random.integers(0, 256, (4, 5, 3)).astype(np.uint8),
        random.integers(-1, 2, (3, 2)).astype(np.int8),
        random.random((3, 2)).astype(np.float32),
    )
    again = Example.of(json.loads(json.dumps(example.as_json())))
    for name in ("picture", "labels", "probabilities"):
        np.testing.assert_array_equal(getattr(again, name), getattr(example, name))


def test_auc_by_distance_is_of_the_sensors_asked_for() -> None:
    targets = np.array([[0.0, 0, 0], [0.05, 0, 0], [0.2, 0, 0]])
    auc = np.array([[0.6, 0.9, 0.6], [0.7, 0.95, 0.7], [0.5, 0.5, np.nan]])
    many = np.full((3, 3), 50)
    score = Score(targets, ("left", "center", "right"), auc, auc, auc, many, many, 0.7)
    assert crossval._at(score, 0.04, 0.08, centre=True) == pytest.approx(0.95)
    assert crossval._at(score, 0.04, 0.08, centre=False) == pytest.approx(0.7)
    assert crossval._at(score, 0.0, 0.3) == pytest.approx(np.nanmean(auc))
    assert np.isnan(crossval._at(score, 0.5, 0.6))


def test_the_best_distance_is_told_where_enough_is_known() -> None:
    targets = np.stack([np.arange(6) / 100, np.zeros(6), np.zeros(6)], -1)
    auc = np.array([[0.6], [0.7], [0.9], [0.8], [0.6], [1.0]])
    enough = np.full((6, 1), 10)
    few = np.array([[10], [10], [10], [10], [10], [9]])
    score = Score(targets, ("center",), auc, auc, auc, few, enough, 0.8)
    assert crossval._peak(score, centre=True) == pytest.approx(0.02)
    assert crossval._at(score, 0.04, 0.05, centre=True) == pytest.approx(0.6)
    nothing = Score(targets, ("center",), auc, auc, auc, enough * 0, enough, 0.8)
    assert np.isnan(crossval._peak(nothing, centre=True))
