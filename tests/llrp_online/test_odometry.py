import numpy as np
import pytest
from scipy import stats

from llrp_online.motion_noise import MotionNoise
from llrp_online.odometry import WheelOdometry
from replay.poses import compose, wrap

TRACK_M, DT_S, STEPS, RUNS = 0.095, 0.05, 120, 100
WHEEL_NOISE, GYRO_NOISE = 0.005, 0.01


def drive(seed, *, gyro):
    """A winding run: true wheel speeds differ from the reported ones as the model says. True pose, filter's answer."""
    rng = np.random.default_rng(seed)
    odometry = WheelOdometry(TRACK_M, WHEEL_NOISE, GYRO_NOISE)
    truth = np.zeros(3)
    answer = truth, np.zeros((3, 3))
    for step in range(STEPS):
        speeds_m_s = np.array([0.12 + 0.04 * np.sin(step / 20), 0.12 + 0.04 * np.cos(step / 33)])
        wheels_m = speeds_m_s * DT_S
        true_m = wheels_m + rng.standard_normal(2) * WHEEL_NOISE * np.sqrt(np.abs(wheels_m))
        forward_m, turn_rad = true_m.mean(), (true_m[1] - true_m[0]) / TRACK_M
        half = turn_rad / 2
        truth = compose(truth, [forward_m * np.cos(half), forward_m * np.sin(half), turn_rad])
        rate = (turn_rad + rng.standard_normal() * GYRO_NOISE * np.sqrt(DT_S)) / DT_S if gyro else None
        answer = odometry.step(DT_S, *speeds_m_s, yaw_rate_rad_s=rate)
    return truth, *answer


@pytest.mark.parametrize("gyro", [False, True])
def test_errors_are_as_large_as_the_covariance_says(gyro):
    normalised, yaw_normalised = [], []
    for seed in range(RUNS):
        truth, pose, covariance = drive(seed, gyro=gyro)
        error = truth - pose
        error[2] = wrap(error[2])
        normalised.append(error @ np.linalg.solve(covariance, error))
        yaw_normalised.append(error[2] ** 2 / covariance[2, 2])
    for sums, degrees in ((normalised, 3 * RUNS), (yaw_normalised, RUNS)):
        low, high = stats.chi2.ppf([0.001, 0.999], degrees)
        assert low < np.sum(sums) < high


def test_a_gyro_reduces_the_variance_of_the_heading_and_its_error():
    variances, errors = {}, {}
    for gyro in (False, True):
        runs = [drive(seed, gyro=gyro) for seed in range(20)]
        variances[gyro] = np.mean([covariance[2, 2] for _, _, covariance in runs])
        errors[gyro] = np.mean([wrap(truth[2] - pose[2]) ** 2 for truth, pose, _ in runs])
    assert variances[True] < 0.6 * variances[False]
    assert errors[True] < errors[False]


def test_straight_on_and_turning_in_place():
    odometry = WheelOdometry(TRACK_M)
    for _ in range(20):
        pose, _ = odometry.step(0.05, 0.1, 0.1)
    np.testing.assert_allclose(pose, [0.1, 0, 0], atol=1e-12)
    for _ in range(20):
        pose, covariance = odometry.step(0.05, -0.05, 0.05)
    np.testing.assert_allclose(pose, [0.1, 0, 0.1 / TRACK_M], atol=1e-12)
    assert covariance[2, 2] > 0


def test_a_circle_comes_back_to_its_start():
    odometry = WheelOdometry(TRACK_M)
    outer_m_s, inner_m_s = 2 * np.pi * (0.5 + TRACK_M / 2) / 10, 2 * np.pi * (0.5 - TRACK_M / 2) / 10
    for _ in range(100):
        pose, _ = odometry.step(0.1, inner_m_s, outer_m_s)
    np.testing.assert_allclose(pose, 0, atol=1e-9)


def test_the_covariance_stays_symmetric_and_never_negative():
    odometry = WheelOdometry(TRACK_M, wheel_noise_m_per_sqrt_m=0.05, gyro_noise_rad_per_sqrt_s=1e-6)
    rng = np.random.default_rng(0)
    for _ in range(2000):
        left, right, rate = rng.normal(0, 0.2, 3)
        _, covariance = odometry.step(0.05, left, right, rate if rng.random() < 0.5 else None)
        assert np.array_equal(covariance, covariance.T)
        assert np.linalg.eigvalsh(covariance).min() > -1e-15 * np.trace(covariance)


def test_standing_still_adds_nothing_even_with_an_exact_gyro():
    odometry = WheelOdometry(TRACK_M, gyro_noise_rad_per_sqrt_s=0.0)
    pose, covariance = odometry.step(0.05, 0.0, 0.0, 0.0)
    assert not pose.any()
    assert not covariance.any()


def test_answers_are_copies():
    odometry = WheelOdometry(TRACK_M)
    pose, covariance = odometry.step(0.05, 0.1, 0.1)
    pose[:], covariance[:] = 9, 9
    again, _ = odometry.step(0.05, 0.1, 0.1)
    np.testing.assert_allclose(again, [0.01, 0, 0], atol=1e-12)


def test_wheel_odometry_says_what_it_expected():
    with pytest.raises(ValueError, match="track_m: expected more than 0, got 0"):
        WheelOdometry(0)
    with pytest.raises(ValueError, match="dt_s: expected more than 0, got -1"):
        WheelOdometry(TRACK_M).step(-1, 0.1, 0.1)


@pytest.mark.parametrize(
    ("step", "heading", "position"),
    [
        ((0.3, 0.4, 0.0), 0.04**2 * 0.5, 0.02**2 * 0.5),
        ((0.0, 0.0, -2.0), 0.03**2 * 2, 0.0),
        ((0.0, 0.0, 0.0), 0.0, 0.0),
        ((-0.5, 0.0, 1.0), 0.04**2 * 0.5 + 0.03**2, 0.02**2 * 0.5),
    ],
)
def test_motion_noise_grows_with_way_and_turn(step, heading, position):
    assert MotionNoise(0.03, 0.04, 0.02)(*step) == pytest.approx((heading, position, 0.0, position))


def test_motion_noise_does_not_depend_on_how_a_way_is_cut():
    noise = MotionNoise(0.03, 0.04, 0.02)
    assert noise(1.0, 0.0, 0.0) == pytest.approx(tuple(10 * part for part in noise(0.1, 0.0, 0.0)))
