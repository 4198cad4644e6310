"""Why is it not learning: one test a cause, and none where all is well."""

from dataclasses import replace

import pytest

from agents.dashboard.diagnosis import Evidence, diagnose
from llrp_online.prequential import Band
from llrp_online.status import LearnerStatus

GOING = LearnerStatus(
    robot_s=120.0,
    frames=1200,
    waiting=300,
    labelled=1100,
    known=[9000, 5000],
    positives=[500, 400],
    remembered=900,
    steps=600,
    let_go=0.0,
    loss=0.1,
    version=50,
    version_age_s=1.0,
    rejected=2,
    bands=[Band(0.0, 0.3, 0.93, 900, 13100, 0.1)],
    drift_events=0,
    drops={},
    paused=False,
)
BEFORE = replace(GOING, robot_s=100.0, frames=1000, labelled=900, remembered=700, steps=500, version=40)
WELL = Evidence(learner=GOING, before=BEFORE)
STUCK = replace(WELL, learner=replace(GOING, labelled=900, remembered=700))


def causes(seen):
    return [finding.cause for finding in diagnose(seen)]


def test_nothing_is_wrong():
    [finding] = diagnose(WELL)
    assert (finding.cause, finding.grade) == ("learning", "fine")
    assert "version 50" in finding.what
    assert "0.93" in finding.what


@pytest.mark.parametrize(
    ("cause", "grade", "seen", "word"),
    [
        ("no learner", "stops", replace(WELL, learner=None, before=None, learner_s=None), "llrp learn"),
        ("learner silent", "stops", replace(WELL, learner_s=9.0), "silent for 9 s"),
        ("paused", "stops", replace(WELL, learner=replace(GOING, paused=True)), "Resume"),
        ("stopped", "slows", replace(WELL, stopped=True), "Release"),
        ("no predictions", "note", replace(WELL, predicting=None), "llrp perceive"),
        ("odometry missing", "stops", replace(WELL, odometry_s=None), "on odom"),
        ("odometry missing", "stops", replace(WELL, odometry_s=3.0), "odom has been silent for 3 s"),
        ("camera missing", "stops", replace(WELL, camera_s=4.0), "camera has been silent"),
        ("short range missing", "stops", replace(WELL, range_s=None), "on range"),
        (
            "short range missing",
            "stops",
            replace(WELL, range_s=None, at_changes=True),
            "press each bumper once",
        ),
        (
            "odometry unusable",
            "stops",
            replace(WELL, useless={"odometry unusable": "odom: position not finite"}),
            "cannot be used: odom: position not finite",
        ),
        ("camera missing", "stops", replace(WELL, camera_s=4.0, camera_says="frozen for 4 s"), "camera frozen for 4 s"),
        ("camera frozen", "stops", replace(WELL, frozen_s=5.0), "same picture for 5 s"),
        ("standing still", "stops", replace(STUCK, moved_m=0.0), "llrp control"),
        ("window too short", "stops", replace(STUCK, nearest_m=2.0, farthest_m=5.0), "labels.window_s = 30 s"),
        (
            "window too short",
            "stops",
            replace(STUCK, nearest_m=2.0, farthest_m=5.0, drift=True, back_s=4.0),
            "labels.gate_m",
        ),
        (
            "window too short",
            "note",
            replace(WELL, farthest_m=5.0, learner=replace(GOING, known=[14000, 0], positives=[900, 0])),
            "until 5.00 m",
        ),
        ("tolerance too tight", "stops", replace(STUCK, missed_m=0.03), "3.0 cm, and 1.0 cm are allowed"),
        ("heading tolerance too tight", "stops", replace(STUCK, turned_rad=0.2), "labels.heading_tolerance_rad"),
        ("no labels", "stops", STUCK, "clocks"),
        ("one class only", "stops", replace(WELL, learner=replace(GOING, positives=[0, 0])), "felt something"),
        ("one class only", "slows", replace(WELL, learner=replace(GOING, positives=[8999, 5000])), "felt nothing"),
        (
            "warming up",
            "note",
            replace(WELL, learner=replace(GOING, labelled=5, steps=0, version=None), before=None),
            "training begins at 32",
        ),
        ("throttled", "slows", replace(WELL, learner=replace(GOING, let_go=60.0)), "training.core_share"),
        ("backlog", "slows", replace(WELL, learner=replace(GOING, backlog=2000)), "2000 messages"),
        (
            "rejected by the gate",
            "slows",
            replace(WELL, learner=replace(GOING, rejected=9, version=40)),
            "The last 7 weights",
        ),
        ("waiting", "note", replace(WELL, learner=replace(GOING, version=None), before=None), "no weights yet"),
    ],
)
def test_a_cause_is_named_with_what_to_do(cause, grade, seen, word):
    [finding] = [finding for finding in diagnose(seen) if finding.cause == cause]
    assert finding.grade == grade
    assert word in f"{finding.what} {finding.do}"
    assert finding.do


def test_the_worst_comes_first_and_explains_the_rest():
    assert causes(replace(STUCK, odometry_s=None, missed_m=0.5, stopped=True)) == ["odometry missing", "stopped"]


def test_who_has_only_just_come_does_not_complain():
    just = replace(WELL, watched_s=1.0, odometry_s=None, camera_s=None, range_s=None, learner_s=None, learner=None)
    assert causes(replace(just, before=None)) == ["waiting"]


def test_a_frozen_picture_of_a_robot_that_stands_is_no_fault():
    assert causes(replace(WELL, frozen_s=60.0, moved_m=0.0)) == ["learning"]


def test_far_targets_that_have_labels_are_within_reach_wherever_the_robot_is_now():
    assert causes(replace(WELL, farthest_m=5.0)) == ["learning"]


def test_a_heading_that_does_not_matter_is_never_too_tight():
    assert causes(replace(STUCK, turned_rad=3.0, tolerance_rad=None)) == ["no labels"]


def test_rejections_that_newer_weights_followed_are_no_fault():
    assert causes(replace(WELL, learner=replace(GOING, rejected=20))) == ["learning"]
