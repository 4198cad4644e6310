"""The study of disturbances: what they are, and the arithmetic of falls and recoveries on made-up marks."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.experiments import robustness
from agents.experiments.bars import paired_bars
from agents.experiments.disturbances import DISTURBANCES, floor_coloured
from agents.experiments.robustness import FULL, QUICK, Outcome, Size, findings, trials
from agents.experiments.settings import changed, configuration_of, scenario, scenarios, values_of
from agents.experiments.statistics import ratio
from agents.robots.simulated import Scenario
from agents.robots.simulated.camera import Optics
from agents.robots.simulated.layout import Layout

USUAL = configuration_of("thymio")
SIZE = Size(("wood",), 1.0, ("tiles", "grass"), (0, 1), (0, 90, 180), 1.0, ("camera at 60 cm", "half as bright"))
AUCS = st.floats(0.4, 1.0)


def results(of):
    """Trials' results with `of(disturbance, run, mark)` as AUC."""
    run, found = dict.fromkeys([name for name, _ in robustness._named(SIZE)], 0), []
    for name, _ in robustness._named(SIZE):
        marks = [
            {"lived_s": mark_s, "here": {"far": of(name, run[name], mark), "near": None, "cells": 9}}
            for mark, mark_s in enumerate(SIZE.marks_s)
        ]
        found.append({"marks": marks})
        run[name] += 1
    return found


def made_up(name, run, mark):
    """Undisturbed .90 and up by .02 a mark; the camera costs .20, of which .17 come back; the light costs .01."""
    falls = {
        "undisturbed": (0.0, 0.0, 0.0),
        "camera at 60 cm": (0.20, 0.10, 0.03),
        "camera at 60 cm, begun without its memory": (0.20, 0.10, 0.05),
        "camera at 60 cm, begun from nothing": (0.40, 0.30, 0.10),
        "half as bright": (0.01, 0.01, 0.01),
    }
    return 0.90 + 0.02 * mark + 0.001 * run - falls[name][mark]


def claims(of):
    return {claim.what: claim for claim in findings(SIZE, results(of)).claims}


def test_falls_and_shares_are_what_they_are_called():
    found = claims(made_up)
    assert found["undisturbed: mean AUC at once"].value == pytest.approx(0.9015)
    assert found["undisturbed: mean AUC after 3 min"].value == pytest.approx(0.9415)
    assert found["camera at 60 cm: fall at once"].value == pytest.approx(0.20)
    assert found["camera at 60 cm: left after 3 min"].value == pytest.approx(0.03)
    assert found["camera at 60 cm: share won back after 3 min"].value == pytest.approx((0.91 - 0.70) / 0.20)
    assert found["camera at 60 cm: share won back after 3 min, net of learning"].value == pytest.approx(0.17 / 0.20)
    assert found["camera at 60 cm: fall at once"].n == "4 runs: 2 scenarios x 2 seeds"


def test_whoever_begins_otherwise_is_held_to_the_same_fall():
    found = claims(made_up)
    for way, left in (("without its memory", 0.05), ("from nothing", 0.10)):
        share = found[f"camera at 60 cm, begun {way}: share won back after 3 min"].value
        assert share == pytest.approx((0.94 - left - 0.70) / 0.20)


def test_only_a_camera_pose_has_a_bar():
    bars = {what: claim.bar for what, claim in claims(made_up).items()}
    assert {what for what, bar in bars.items() if bar is not None} == {
        "camera at 60 cm: share won back after 3 min",
        "camera at 60 cm: share won back after 3 min, net of learning",
    }
    assert bars["camera at 60 cm: share won back after 3 min"] == 0.80


def test_a_share_of_next_to_nothing_is_blank():
    share = claims(made_up)["half as bright: share won back after 3 min"]
    assert share.value is None
    assert share.interval is None


def test_shares_are_told_by_mark():
    told = findings(SIZE, results(made_up)).numbers["won_back_by_mark"]
    assert told["camera at 60 cm"] == pytest.approx([(0.82 - 0.70) / 0.20, (0.91 - 0.70) / 0.20])
    assert told["half as bright"] == [None, None]


def test_a_run_with_a_blank_is_left_out_of_its_disturbance_alone():
    def one_blank(name, run, mark):
        return None if (name, run) == ("camera at 60 cm", 2) else made_up(name, run, mark)

    found = claims(one_blank)
    assert found["camera at 60 cm: fall at once"].value == pytest.approx(0.20)
    assert found["camera at 60 cm: fall at once"].n == "3 runs: 2 scenarios x 2 seeds"
    assert found["half as bright: fall at once"].n == "4 runs: 2 scenarios x 2 seeds"


def test_with_blanks_alone_all_is_blank():
    found = claims(lambda name, run, mark: None if name != "undisturbed" else made_up(name, run, mark))
    assert all(claim.value is None for what, claim in found.items() if not what.startswith("undisturbed"))


def test_all_figures_can_be_drawn_and_have_their_words():
    plots = findings(SIZE, results(made_up)).plots
    assert [plot.name for plot in plots] == [
        "falls",
        "recovery_camera_pose",
        "recovery_picture",
        "ways_to_begin",
    ]
    assert all(plot.alt for plot in plots)


@given(st.lists(st.tuples(AUCS, AUCS, AUCS, AUCS), min_size=1, max_size=6))
def test_what_is_left_is_the_cost_less_the_gain_beyond_undisturbed_learning(runs):
    first, last, usual_first, usual_last = np.array(runs).T
    found = Outcome.of(np.stack([first, last], 1), np.stack([usual_first, usual_last], 1))
    np.testing.assert_allclose(found.left, found.cost - found.gain + (usual_last - usual_first), atol=1e-12)


@given(st.lists(st.tuples(st.floats(0.03, 0.5), st.floats(0, 1)), min_size=1, max_size=9))
def test_a_ratio_lies_in_its_interval_and_that_among_what_runs_allow(pairs):
    wholes, shares = np.array(pairs).T
    value, (low, high) = ratio(shares * wholes, wholes)
    assert 0 <= low <= value + 1e-12
    assert value - 1e-12 <= high


def test_a_ratio_needs_pairs():
    with pytest.raises(ValueError, match="got 2 above and 1 below"):
        ratio([1.0, 2.0], [1.0])
    with pytest.raises(ValueError, match="got 0 above and 0 below"):
        ratio([], [])


def test_rows_without_a_value_leave_their_place_empty():
    figure = paired_bars({"a": ((0.1, (0.05, 0.2)), None), "b": (None, None)}, ("before", "after"), "fall")
    (axes,) = figure.axes
    assert [label.get_text() for label in axes.get_yticklabels()] == ["a", "b"]
    assert [len(bars) for bars in axes.containers] == [1, 0]


@pytest.mark.parametrize("size", [FULL, QUICK], ids=["full", "quick"])
def test_what_is_tried_was_never_lived_in_and_every_trial_is_another(size):
    assert not set(size.before) & set(size.scenarios)
    assert {*size.before, *size.scenarios} <= set(scenarios())
    found = [trial.name for trial in trials(size)]
    poses = sum(DISTURBANCES[name].kind == "camera pose" for name in size.disturbances)
    assert (
        len(set(found))
        == len(found)
        == (1 + len(size.disturbances) + 2 * poses) * len(size.scenarios) * len(size.seeds)
    )


def test_the_full_study_is_of_every_disturbance_and_several_runs():
    assert set(FULL.disturbances) == set(DISTURBANCES)
    assert len(FULL.scenarios) >= 2
    assert len(FULL.seeds) >= 3


def test_each_trial_starts_undisturbed_and_is_examined_as_it_lives():
    for name, trial in robustness._named(QUICK):
        if name.endswith("from nothing"):
            assert trial.parameters["start"] is None
            continue
        assert trial.parameters["start"]["memory"] == (not name.endswith("without its memory"))
        lived, (here, there) = trial.parameters["lived"], trial.parameters["exams"]["here"]
        assert trial.parameters["start"]["lived"][0]["configuration"] == values_of(USUAL)
        for drive in (here, there):
            assert drive["configuration"] == lived[0]["configuration"]
            assert drive["scenario"] == lived[0]["scenario"]
            assert drive["seed"] not in {lived[0]["seed"], trial.parameters["start"]["lived"][0]["seed"]}
        assert here["seed"] != there["seed"]


@pytest.mark.parametrize("name", DISTURBANCES)
@pytest.mark.parametrize("floor", FULL.scenarios)
def test_a_disturbance_changes_something_and_leaves_everything_in_its_place(name, floor):
    """So that the same seed makes the same labels, and a fall is the camera's alone."""
    disturbance, arena = DISTURBANCES[name], scenario(floor)
    other = changed(USUAL, disturbance.robot)
    told = disturbance.arena(arena)
    assert (other != USUAL) or (told != arena)
    assert arena == scenario(floor)
    usual, found = (Layout.draw(Scenario.model_validate(of), 3) for of in (arena, told))
    assert found.start == usual.start
    for one, now in zip(usual.shapes, found.shapes, strict=True):
        assert (one.kind, one.centre_m, one.half_m, one.yaw_rad) == (now.kind, now.centre_m, now.half_m, now.yaw_rad)


def test_obstacles_like_the_floor_wear_its_surface_and_walls_do_not():
    arena = Scenario.model_validate(floor_coloured(scenario("tiles")))
    shapes = Layout.draw(arena, 0).shapes
    assert {shape.surface.name for shape in shapes[4:]} == {"pale tiles"}
    assert {shape.surface.name for shape in shapes[:4]} == {"plaster"}


def ground_m(simulation):
    """Where the picture's last and first row meet the floor, ahead of the camera."""
    rays = Optics.build(simulation, 64, 80).directions.reshape(64, 80, 3)[:, 40]
    return [float(-simulation.camera_height_m * rays[row, 0] / rays[row, 2]) for row in (63, 0)]


@pytest.mark.parametrize("name", ["camera at 60 cm", "camera at 95 cm"])
def test_from_higher_up_the_camera_sees_all_the_floor_it_usually_sees(name):
    near_m, far_m = ground_m(changed(USUAL, DISTURBANCES[name].robot).simulation)
    usual_near_m, usual_far_m = ground_m(USUAL.simulation)
    assert near_m == pytest.approx(usual_near_m, abs=0.01)
    assert far_m >= usual_far_m


def test_the_full_study_has_no_chairs_where_a_mast_would_pass_through_them():
    for name in FULL.scenarios:
        assert all(group["kind"] != "chair" for group in scenario(name)["obstacles"])


def test_the_bar_is_for_three_minutes():
    assert FULL.marks_s[-1] == robustness._BAR_S == 180
