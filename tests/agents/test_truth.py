"""The truth of labels: what the sensors would have felt, where the robot truly was."""

import numpy as np
import pytest

from agents.behaviours import controller
from agents.drive_arrays import drive_of
from agents.experiments.drives import Drive
from agents.experiments.labelling import judged, label
from agents.experiments.settings import changed, configuration_of, scenario
from agents.experiments.truth import NOWHERE, Truth, driven
from agents.robots.simulated import Scenario
from agents.robots.simulated.layout import Layout, Shape
from agents.rollout import RangeBits, rollout
from agents.simulated_drive import record_drive, simulated_robot
from llrp_online.windows import DRIFT, UNLIMITED
from replay.resolution import Labels

USUAL = configuration_of("thymio")
ARENA = Scenario.model_validate(scenario("tiles"))
EXACT = changed(USUAL, {"simulation.slip": 0.0, "simulation.bias": 0.0, "simulation.range_noise_m": 0.0})


def drive(form, minutes=1.0, behaviour="explore", seed=3):
    return Drive(form.model_dump(mode="json"), scenario("tiles"), seed, minutes, behaviour)


def test_truth_is_what_a_robot_without_noise_feels_there():
    robot = simulated_robot(EXACT, ARENA, 3, camera=False)
    truth, bits_of = Truth(EXACT, robot.layout), RangeBits(EXACT.short_range)
    felt = 0
    for seen in rollout(robot, controller("walk", EXACT, 3), EXACT, 30.0):
        bits = bits_of(seen.ranges)
        felt += int(bits.sum())
        np.testing.assert_array_equal(truth.bits(seen.true_pose), bits)
    assert felt > 50


def test_noise_of_the_sensors_is_not_in_the_truth():
    robot = simulated_robot(USUAL, ARENA, 3, camera=False)
    loud = changed(USUAL, {"simulation.range_noise_m": 0.05})
    poses = np.array([seen.true_pose for seen in rollout(robot, controller("walk", USUAL, 3), USUAL, 10.0)][::20])
    for one in poses:
        np.testing.assert_array_equal(Truth(loud, robot.layout).bits(one), Truth(EXACT, robot.layout).bits(one))


def test_targets_lie_ahead_of_where_the_robot_truly_was():
    known = driven(drive(EXACT, 0.3))
    labels = Truth(EXACT, known.layout).labels(known.frames[:3])
    truth, targets = Truth(EXACT, known.layout), EXACT.targets.build().poses
    assert labels.shape == (3, len(targets), 5)
    x, y, yaw = known.frames[1]
    ahead = np.array([x + targets[9, 0] * np.cos(yaw), y + targets[9, 0] * np.sin(yaw), yaw])
    np.testing.assert_array_equal(labels[1, 9], truth.bits(ahead))


def test_a_drive_without_a_camera_is_the_drive_that_is_recorded(tmp_path):
    record_drive(USUAL, ARENA, 3, 0.05, tmp_path / "d.mcap")
    recorded, again = drive_of(USUAL, tmp_path / "d.mcap"), driven(drive(USUAL, 0.05)).arrays
    for one, two in zip(recorded, again, strict=True):
        np.testing.assert_allclose(one, two, atol=1e-9)


@pytest.mark.parametrize(
    ("gap_m", "expected"),
    [(0.2, [0, 0, 0, 0, 0]), (0.05, [0, 1, 1, 1, 0]), (-0.005, [0, 1, 1, 1, 0]), (-0.02, [NOWHERE] * 5)],
)
def test_a_wall_is_felt_up_to_the_tolerance_within_it(gap_m, expected):
    surface = ARENA.surface[0]
    simulation = EXACT.simulation
    face_m = simulation.centre_ahead_m + simulation.radius_m + gap_m
    wide = Shape("box", (face_m + 0.3, 0.0, 0.1), (0.3, 0.04, 0.1), surface)
    layout = Layout(ARENA, [wide], (0.0, 0.0, 0.0))
    assert Truth(EXACT, layout).bits(np.zeros(3)).tolist() == expected


def test_beyond_the_walls_there_is_nowhere_to_stand():
    layout = Layout.draw(ARENA, 3)
    outside = np.array([ARENA.arena.length_m / 2 + 0.5, 0.0, 0.0])
    assert Truth(EXACT, layout).bits(outside).tolist() == [NOWHERE] * 5


def test_exact_odometry_is_hardly_contradicted_whatever_the_window():
    told = label(None, drive(EXACT).as_json())["windows"]
    for name, one in told.items():
        assert one["contradicted"] < 0.012, name  # the edges of things, within the tolerances
        assert one["nowhere"] == 0.0
    assert told[UNLIMITED]["contradicted"] < told["1 s"]["contradicted"] + 0.004
    assert told[UNLIMITED]["known"] > 1.3 * told["1 s"]["known"]


def test_worse_odometry_is_contradicted_more_and_drift_holds_back():
    shares = []
    for slip, bias in ((0.0, 0.0), (0.05, 0.01), (0.15, 0.04)):
        form = changed(USUAL, {"simulation.slip": slip, "simulation.bias": bias})
        told = label(None, drive(form).as_json())["windows"]
        shares.append(told[UNLIMITED]["contradicted"])
        assert told[DRIFT]["contradicted"] <= told[UNLIMITED]["contradicted"]
    assert shares == sorted(shares)
    assert shares[-1] > 2 * shares[0]
    assert told["1 s"]["contradicted"] < told[UNLIMITED]["contradicted"]
    assert told[DRIFT]["known"] < told[UNLIMITED]["known"]


def test_labels_are_counted_beside_the_truth():
    labels = np.array([[[1, 0, -1, 1]], [[0, 0, 0, 1]]], np.int8)
    truth = np.array([[[1, 1, 0, 0]], [[0, 0, 0, NOWHERE]]], np.int8)
    weight = np.where(labels >= 0, 0.5, 0.0).astype(np.float32)
    weight[0, 0, 1] = 0.0
    found = Labels(labels, weight, np.array([True, True]), np.zeros((2, 1, 1), np.float32))
    told = judged(found, truth)
    assert told["known"] == 3.5
    assert told["positive"] == 1.5
    assert told["contradicted"] == pytest.approx(3 / 7)
    assert told["positives"] == pytest.approx(2 / 3)
    assert told["negatives"] == pytest.approx(1 / 4)
    assert told["weighted"] == pytest.approx(2 / 6)
    assert told["nowhere"] == pytest.approx(1 / 7)
    said, so = [1, 0, 1, 0, 0, 0, 1], [1, 1, 0, 0, 0, 0, 0]
    assert told["true_worth"] == pytest.approx(3.5 * np.corrcoef(said, so)[0, 1] ** 2)
