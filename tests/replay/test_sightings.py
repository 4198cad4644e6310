"""Places felt twice, and the age of labels, against the same read in plain Python."""

import math

import numpy as np
import pytest

from replay.resolution import Drive, resolve
from replay.rule import LabelRule, OdometryLimits
from replay.sightings import sightings
from replay.targets import Targets
from tests.replay import worlds

LIMITS = OdometryLimits(max_gap_s=2.0, max_speed_m_s=5.0)
STREAMS = [[0, 1], [2]]
SECOND_NS = 1_000_000_000


def no_noise(_x, _y, _turn):
    return 0.0, 0.0, 0.0, 0.0


def way_noise(x, y, _turn):
    return 0.0, 1e-4 * math.hypot(x, y), 0.0, 1e-4 * math.hypot(x, y)


def drive_along(poses, bits, covariances=None):
    """One pose, one reading and one frame a second, each at its place."""
    t_ns = np.arange(len(poses), dtype=np.int64) * SECOND_NS
    poses = np.array([[*pose, 0.0, 0.0][:3] for pose in poses], np.float64)
    bits = np.array(bits, np.int8).reshape(len(poses), -1)
    return Drive(t_ns, poses, covariances, t_ns, np.zeros(len(poses), np.int64), bits, t_ns)


def pairs(found):
    told = zip(found.apart_s.tolist(), found.first.tolist(), found.again.tolist(), strict=True)
    return sorted((round(apart, 6), *first, *again) for apart, first, again in told)


def test_there_and_back_feels_each_place_twice_but_the_end():
    drive = drive_along([(0.0,), (0.1,), (0.2,), (0.1,), (0.0,)], [0, 0, 1, 1, 0])
    assert pairs(sightings(drive, [[0]], LabelRule(0.02), LIMITS, no_noise)) == [(2.0, 0, 1), (4.0, 0, 0)]


def test_a_robot_that_stays_feels_nothing_twice():
    drive = drive_along([(0.0,), (0.01,), (0.0,), (0.005,)], [0, 1, 0, 1])
    assert not pairs(sightings(drive, [[0]], LabelRule(0.02), LIMITS, no_noise))


def test_of_a_visit_the_nearest_reading_counts():
    drive = drive_along([(0.0,), (0.5,), (0.015,), (0.001,), (0.018,)], [0, 0, 0, 1, 0])
    assert (3.0, 0, 1) in pairs(sightings(drive, [[0]], LabelRule(0.02), LIMITS, no_noise))


def test_another_heading_is_another_place_unless_it_is_ignored():
    drive = drive_along([(0.0, 0.0, 0.0), (0.5, 0.0, 0.0), (0.0, 0.0, 1.0)], [0, 0, 1])
    assert not pairs(sightings(drive, [[0]], LabelRule(0.02, 0.1), LIMITS, no_noise))
    assert pairs(sightings(drive, [[0]], LabelRule(0.02, None), LIMITS, no_noise)) == [(2.0, 0, 1)]


def test_nothing_is_felt_twice_across_a_pose_jump():
    drive = drive_along([(0.0,), (9.0,), (0.0,)], [0, 0, 0])
    assert not pairs(sightings(drive, [[0]], LabelRule(0.02), LIMITS, no_noise))


def test_what_odometry_says_of_itself_grows_with_the_way_between():
    drive = drive_along([(0.0,), (0.1,), (0.2,), (0.1,), (0.0,)], [0, 0, 1, 1, 0])
    found = sightings(drive, [[0]], LabelRule(0.02), LIMITS, way_noise)
    assert found.deviation_m.tolist() == pytest.approx([math.sqrt(0.4e-4), math.sqrt(0.2e-4)])


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("heading_rad", [None, 0.4])
def test_every_pair_of_a_random_drive_is_what_plain_python_finds(seed, heading_rad):
    drive = random_drive(np.random.default_rng(seed))
    rule = LabelRule(0.1, heading_rad)
    found = sightings(drive, STREAMS, rule, OdometryLimits(0.35, 3.0), no_noise)
    poses = np.stack([np.interp(drive.readings_ns, drive.odometry_ns, column) for column in drive.poses.T], -1)
    expected = []
    for stream in (0, 1):
        rows = np.flatnonzero(drive.stream == stream).tolist()
        for at, one in enumerate(rows):
            away, visit = False, []
            for two in [*rows[at + 1 :], None]:
                if two is not None and _near(poses[one], poses[two], rule):
                    if away:
                        visit.append((math.hypot(*(poses[two] - poses[one])[:2]), two))
                    continue
                away = True
                if visit:
                    two = min(visit)[1]
                    apart = round(float(drive.readings_ns[two] - drive.readings_ns[one]) * 1e-9, 6)
                    expected.append((apart, *drive.bits[one].tolist(), *drive.bits[two].tolist()))
                    visit = []
    assert len(expected) > 20
    assert pairs(found) == sorted(expected)


def _near(one, two, rule):
    turned = abs(math.remainder(two[2] - one[2], math.tau))
    close = math.hypot(*(two - one)[:2]) <= rule.position_tolerance_m
    return close and (rule.heading_tolerance_rad is None or turned <= rule.heading_tolerance_rad)


def random_drive(rng):
    """Without jumps and gaps, yaw unwrapped, as arrays."""
    odometry, readings, frames = worlds.drive(rng, 30.0, STREAMS, jumps=False, dropouts=False)
    first_ns, last_ns = odometry[0].t_ns, odometry[-1].t_ns
    readings = sorted((r for r in readings if first_ns <= r.t_ns <= last_ns), key=lambda r: (r.t_ns, r.stream))
    poses = np.array([sample.pose for sample in odometry])
    poses[:, 2] = np.unwrap(poses[:, 2])
    return Drive(
        np.array([sample.t_ns for sample in odometry]),
        poses,
        None,
        np.array([r.t_ns for r in readings]),
        np.array([r.stream for r in readings]),
        np.array([[*r.bits, -1][:2] for r in readings], np.int8),
        np.array([frame.t_ns for frame in frames]),
    )


@pytest.mark.parametrize("seed", range(3))
def test_the_age_of_a_label_is_that_of_a_reading_that_says_so(seed):
    drive, rule = random_drive(np.random.default_rng(seed)), LabelRule(0.1, 0.4, window_s=4.0)
    found = resolve(drive, Targets.line(0.0, 0.4, 0.1), STREAMS, rule, OdometryLimits(0.35, 3.0))
    assert found.apart_s.shape == (len(drive.frames_ns), 2, 5)
    assert np.nanmax(found.apart_s) <= 4.0
    for stream, members in enumerate(STREAMS):
        known = (found.labels[:, :, members] >= 0).any(-1)
        assert np.isfinite(found.apart_s[:, stream][known]).all()
        rows = np.flatnonzero(drive.stream == stream)
        for frame, target in np.argwhere(known).tolist():
            ages = np.abs(drive.readings_ns[rows] - drive.frames_ns[frame]) * 1e-9
            same = rows[np.isclose(ages, found.apart_s[frame, stream, target], atol=1e-6)]
            said = drive.bits[same][:, : len(members)].tolist()
            assert found.labels[frame, target, members].tolist() in said
