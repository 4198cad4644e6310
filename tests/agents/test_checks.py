import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agents import messages
from agents.checks import Checker, Finding, check
from llrp_online.configuration import load
from llrp_online.events import OdometrySample
from replay.poses import compose
from replay.recording import Message, read

ROOT = Path(__file__).parents[2]
DATA = ROOT.parent / "shared" / "data"
needs_data = pytest.mark.skipif(not DATA.exists(), reason=f"the real recordings are not at {DATA}")
THYMIO = load(ROOT / "configs" / "thymio.toml")
CAMERA = "camera/image/compressed"
SECOND_NS = 10**9


def drive(
    seconds: float = 20.0,
    rate_hz: float = 10.0,
    pose: Callable[[np.ndarray], np.ndarray] = lambda pose: pose,
    covariance: Callable[[int], np.ndarray | None] = lambda i: np.eye(3) * 1e-4,
    ranges: Callable[[int], list[float]] = lambda i: [0.05 if i % 5 == 0 else math.inf] * 5,
    picture: Callable[[int], np.ndarray] = lambda i: np.random.default_rng(i).integers(0, 256, (64, 80, 3), np.uint8),
    stamp_ns: Callable[[str, int], int] = lambda topic, log_ns: log_ns,
    change: Callable[[str, int, Any], Any] = lambda topic, i, message: message,
    without: tuple[str, ...] = (),
) -> list[Message]:
    """A robot in good order that drives a curve, but for what the arguments spoil."""
    found: list[Message] = []
    at = np.zeros(3)
    for i in range(int(seconds * rate_hz)):
        log_ns = SECOND_NS + round(i / rate_hz * 1e9)
        at = compose(at, [0.12 / rate_hz, 0.0, 0.3 / rate_hz])
        built = {
            "odom": messages.odometry(OdometrySample(stamp_ns("odom", log_ns), pose(at), covariance(i))),
            "range": messages.laser_scan(stamp_ns("range", log_ns), ranges(i), (-0.7, 0.7), (0.0, 0.1)),
            CAMERA: messages.compressed_image(stamp_ns(CAMERA, log_ns), picture(i), "png"),
        }
        for topic, message in built.items():
            if topic not in without:
                message = change(topic, i, message)
                found.append(Message(f"/thymio/{topic}", message.__msgtype__, log_ns, messages.encode(message)))
    return found


def faults(stream: list[Message]) -> list[Finding]:
    return [finding for finding in check(stream, THYMIO) if finding.severity != "note"]


def only(stream: list[Message]) -> Finding:
    [finding] = faults(stream)
    assert finding.cause
    assert finding.mend
    return finding


def test_a_robot_in_good_order_has_rates_and_shares_only():
    found = check(drive(), THYMIO)
    assert {finding.severity for finding in found} == {"note"}
    rates = [finding.topic for finding in found if finding.seen == "200 messages in 19.9 s: 10.0 a second"]
    assert rates == [CAMERA, "odom", "range"]
    assert any(finding.seen.startswith("left: 20.0 % positive of 200 known readings") for finding in found)


def set_back(topic: str, log_ns: int) -> int:
    return log_ns - (5 * SECOND_NS if log_ns > 10 * SECOND_NS else 0)


def test_a_clock_that_jumps_back():
    found = faults(drive(stamp_ns=set_back))
    assert [finding.topic for finding in found] == [CAMERA, "odom", "range"]
    assert {finding.severity for finding in found} == {"error"}
    assert found[0].seen == "the stamps go back 1 time, by 4.900 s at most"
    assert "NTP" in found[0].cause


def test_messages_that_overtake_each_other_are_a_warning():
    late = only(drive(stamp_ns=lambda topic, t: t - (150_000_000 if topic == "odom" and t % SECOND_NS == 0 else 0)))
    assert (late.severity, late.topic) == ("warning", "odom")
    assert "by 0.050 s at most" in late.seen


def test_stamps_never_filled_in():
    found = faults(drive(stamp_ns=lambda topic, t: 0 if topic == CAMERA else t))
    assert found[0].seen == "200 of 200 stamps are zero"
    assert "does not fill in" in found[0].cause


def test_stamps_that_repeat():
    found = only(drive(stamp_ns=lambda topic, t: t // 200_000_000 * 200_000_000 if topic == "range" else t))
    assert found.seen == "100 of 200 stamps repeat the one before"


def test_two_computers_with_clocks_of_their_own():
    found = only(drive(stamp_ns=lambda topic, t: t - 700_000_000 if topic == CAMERA else t))
    assert found.severity == "error"
    assert found.seen.startswith(f"stamps of {CAMERA} lie 0.700 s behind those of odom")


def test_a_recorder_with_another_clock_is_a_note():
    found = check(drive(stamp_ns=lambda topic, t: t + 3600 * SECOND_NS), THYMIO)
    assert any(finding.seen == "recorded 3600.0 s before its stamps" for finding in found)
    assert {finding.severity for finding in found} == {"note"}


def test_a_clock_that_drifts():
    found = faults(drive(stamp_ns=lambda topic, t: t - t // 10))
    assert any("recorded between 0.10 and 2.09 s after its stamps" in finding.seen for finding in found)


def test_odometry_too_slow_for_its_gaps():
    found = faults(drive(rate_hz=1.0, seconds=60))
    assert found[0].seen == "a message every 1.00 s, but poses are joined only within 0.5 s"


def test_a_gap_and_a_dropout():
    stream = [m for m in drive() if not 5 * SECOND_NS < m.log_ns < 8 * SECOND_NS]
    found = {finding.topic: finding.seen for finding in faults(stream)}
    assert found["odom"] == "1 gap longer than 0.5 s, the longest 3.00 s before stamp 8.000 s; each ends the trajectory"
    assert found["range"] == found[CAMERA] == "silent for 3.00 s before stamp 8.000 s"


@pytest.mark.parametrize(("factor", "unit"), [(1000, "millimetres"), (100, "centimetres")])
def test_positions_in_another_unit(factor, unit):
    found = only(drive(pose=lambda pose: pose * [factor, factor, 1.0]))
    assert found.cause.startswith(f"positions in {unit}")
    assert "where at most 0.5 m/s is configured" in found.seen


def test_yaw_in_degrees():
    found = faults(drive(pose=lambda pose: np.array([pose[0], pose[1], math.degrees(pose[2])])))
    assert "degrees where radians are expected" in found[0].cause


def test_yaw_the_wrong_way_round():
    found = only(drive(pose=lambda pose: pose * [1.0, 1.0, -1.0]))
    assert "negate yaw or y" in found.mend


@pytest.mark.parametrize(("turn", "says"), [(math.pi / 2, "quarter"), (math.pi, "backwards")])
def test_axes_that_do_not_point_ahead(turn, says):
    found = only(drive(pose=lambda pose: pose + np.array([0.0, 0.0, turn])))
    assert says in found.cause


def test_a_pose_jump():
    found = only(drive(pose=lambda pose: pose + np.array([2.0 if pose[1] > 0.3 else 0.0, 0.0, 0.0])))
    assert "pose jump" in found.seen
    assert "the largest 2.0" in found.seen


def test_a_parked_robot_without_covariance():
    found = check(drive(pose=lambda pose: np.zeros(3), covariance=lambda i: None), THYMIO)
    assert [finding.seen for finding in found if "moved" in finding.seen] == ["it moved 0.000 m in all"]
    assert any("no covariance is given" in finding.seen for finding in found)


def test_poses_that_are_not_finite():
    found = faults(drive(pose=lambda pose: pose * (math.nan if pose[1] > 0.3 else 1.0)))
    assert any("a pose that is not finite" in finding.seen and "diverged" in finding.cause for finding in found)


@pytest.mark.parametrize(("value", "what"), [(0, "black"), (255, "white")])
def test_pictures_with_nothing_in_them(value, what):
    found = faults(drive(picture=lambda i: np.full((64, 80, 3), value, np.uint8)))
    assert found[0].seen == f"200 of 200 pictures are {what}"


def test_a_frozen_camera():
    found = only(drive(picture=lambda i: np.random.default_rng(min(i, 100)).integers(0, 256, (64, 80, 3), np.uint8)))
    assert found.seen == "99 of 200 pictures repeat the one before exactly"


def noise(height: int, width: int) -> Callable[[int], np.ndarray]:
    return lambda i: np.random.default_rng(i).integers(0, 256, (height, width, 3), np.uint8)


def test_pictures_with_width_and_height_swapped():
    found = faults(drive(picture=noise(120, 96)))
    assert found[0].severity == "error"
    assert found[0].seen == (
        "200 times a picture of width 96 and height 120, where the configuration has width 80 and height 64"
    )
    assert "look swapped" in found[0].mend


def test_pictures_too_small_and_of_several_sizes():
    found = faults(drive(picture=lambda i: noise(48, 60)(i) if i % 3 else noise(64, 80)(i)))
    assert [finding.seen for finding in found] == [
        "pictures of 60x48 are smaller than the network's 80x64",
        "pictures of several sizes: 60x48 (133), 80x64 (67)",
    ]


def test_pictures_of_garbage():
    def spoil(topic: str, i: int, message: Any) -> Any:
        if topic == CAMERA and i % 2:
            message.data = message.data[::-1].copy()
        return message

    found = only(drive(change=spoil))
    assert (found.severity, found.seen) == ("error", "100 of 200 messages: not a decodable picture")


@pytest.mark.parametrize(
    ("value", "severity", "says"),
    [
        (math.inf, "warning", "left is always infinite"),
        (0.0, "error", "left is always zero"),
        (math.nan, "error", "left is always NaN"),
        (0.09, "warning", "left is always positive at the threshold 0.1"),
        (0.2, "warning", "left is never positive at the threshold 0.1"),
        (80.0, "error", "left is never positive at the threshold 0.1, values 80 to 80"),
        (0.001, "error", "left is always positive at the threshold 0.1"),
    ],
)
def test_a_sensor_that_says_one_thing_only(value, severity, says):
    found = only(drive(ranges=lambda i: [0.05 if i % 5 == 0 else math.inf] * 4 + [value]))
    assert found.severity == severity
    assert found.seen.startswith(says)


def test_millimetres_are_named():
    found = faults(drive(ranges=lambda i: [50.0 if i % 5 == 0 else 2000.0] * 5))
    assert len(found) == 5
    assert {finding.cause for finding in found} == {"values in millimetres or centimetres, the threshold in metres"}


def test_sensors_that_say_nan_or_zero_or_one_too_often():
    def ranges(i: int) -> list[float]:
        usual = 0.05 if i % 5 == 0 else math.inf
        return [math.nan if i % 4 else usual, 0.0 if i % 3 == 0 else usual, usual, usual, 0.05 if i == 7 else 0.5]

    assert [finding.seen for finding in faults(drive(ranges=ranges))] == [
        "left is positive in 1 of 200 readings only",
        "center_right is 0 in 67 of 200 readings",
        "right is NaN in 150 of 200 readings",
    ]


def test_a_field_and_a_topic_that_are_not_there():
    found = faults(drive(ranges=lambda i: [0.05 if i % 5 == 0 else math.inf] * 4, without=("odom",)))
    assert [(finding.topic, finding.seen) for finding in found] == [
        ("odom", "no message"),
        ("range", "200 of 200 messages: no `ranges[4]` in a sensor_msgs/msg/LaserScan"),
    ]
    assert "what came is /thymio/camera/image/compressed, /thymio/range" in found[0].cause
    assert found[1].mend == "make `field` agree with the message"


def test_findings_may_be_asked_while_it_runs():
    checker = Checker(THYMIO)
    assert [finding.seen for finding in checker.findings()] == ["no message"] * 3
    for message in drive():
        checker.add(message)
    assert [finding for finding in checker.findings() if finding.severity != "note"] == []


@needs_data
def test_what_is_known_of_real_recordings():
    drone = load(ROOT / "configs" / "drone.toml")
    assert {finding.severity for finding in check(read(DATA / "drone" / "A0.mcap"), drone)} == {"note"}
    gap = [f.seen for f in check(read(DATA / "drone" / "A5.mcap"), drone) if f.topic == "odom" and f.severity != "note"]
    assert gap == ["1 gap longer than 0.5 s, the longest 1.61 s before stamp 138.798 s; each ends the trajectory"]
    assert not any(
        finding.severity == "error" for path in (DATA / "drone").glob("*.mcap") for finding in check(read(path), drone)
    )
