"""A real Thymio without one: wheels, clock, proximity, calibration, camera, and lines that carry nonsense."""

import math
import os
import pty
import re
import tty
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from thymiodirect.assembler import Assembler
from thymiodirect.connection import RemoteNode

from agents import status
from agents.commands import options
from agents.extras import install
from agents.robots.thymio import camera, firmware
from agents.robots.thymio.calibration import Leg, solve
from agents.robots.thymio.clock import BeatClock, HostClock
from agents.robots.thymio.firmware import BEAT_S, LARGEST_TARGET, Firmware, Report
from agents.robots.thymio.link import Link, LinkError
from agents.robots.thymio.proximity import half_m, ranges_m
from agents.robots.thymio.wheels import LONGEST_GAP_BEATS, Wheels
from llrp_online.configuration import Thymio, load
from llrp_online.odometry import WheelOdometry
from replay.poses import wrap
from tests.agents.films import RED, film
from tests.agents.processes import until

pytestmark = pytest.mark.live

SETTINGS = Thymio(speed_unit_m_s=0.00034, track_m=0.095, left_scale=1.02, right_scale=0.97)
WRAP = 1 << 16

speeds = st.integers(-LARGEST_TARGET, LARGEST_TARGET)
#: Beats from one report to the next, and both wheels' speed meanwhile.
steps = st.tuples(st.integers(1, LONGEST_GAP_BEATS), speeds, speeds)


def reports(moves, start=(0, 0, 0)):
    """As the firmware says them: sums over the beats, round and round in 16 bits."""
    beats, left, right = start
    yield Report(beats % WRAP, left % WRAP, right % WRAP, 0, ())
    for count, left_speed, right_speed in moves:
        beats, left, right = beats + count, left + count * left_speed, right + count * right_speed
        yield Report(beats % WRAP, left % WRAP, right % WRAP, 0, ())


starts = st.tuples(*[st.integers(0, WRAP - 1)] * 3)


@given(st.lists(steps, min_size=1, max_size=12), starts)
def test_odometry_is_that_of_the_wheels_wherever_the_sums_begin(moves, start):
    wheels, plain = Wheels(SETTINGS), WheelOdometry(SETTINGS.track_m, SETTINGS.wheel_noise_m_per_sqrt_m)
    said = [wheels.add(report) for report in reports(moves, start)]
    assert said[0] is None
    for moved, (beats, left, right) in zip(said[1:], moves, strict=True):
        pose, covariance = plain.step(beats * BEAT_S, left * 0.00034 * 1.02, right * 0.00034 * 0.97)
        np.testing.assert_allclose(moved.pose, pose, atol=1e-9)
        np.testing.assert_allclose(moved.covariance, covariance, atol=1e-12)


@given(st.lists(st.tuples(st.just(5), speeds, speeds), min_size=2, max_size=12), st.data())
def test_a_lost_report_loses_no_way_and_no_turn(moves, data):
    """Between two reports that came the robot may have turned; how far both wheels rolled is known all the same."""
    every, some = list(reports(moves)), Wheels(SETTINGS)
    lost = data.draw(st.sets(st.integers(1, len(moves) - 1)))
    whole = Wheels(SETTINGS)
    last = [whole.add(report) for report in every][-1]
    got = [some.add(report) for index, report in enumerate(every) if index not in lost][-1]
    assert wrap(got.pose[2] - last.pose[2]) == pytest.approx(0.0, abs=1e-9)
    assert some.metres <= whole.metres + 1e-9  # what went forth and back is rolled once less


@given(st.integers(LONGEST_GAP_BEATS + 1, 60_000), speeds, speeds)
def test_over_a_gap_in_which_the_sums_may_have_gone_round_the_pose_is_not_guessed(gap, left, right):
    wheels = Wheels(SETTINGS)
    said = [wheels.add(report) for report in reports([(5, 100, 100), (gap, left, right), (5, 0, 0)])]
    assert said[2] is None
    assert said[3].pose.tolist() == said[1].pose.tolist()


def test_after_a_restart_the_robot_is_where_it_was():
    wheels = Wheels(SETTINGS)
    before = [wheels.add(report) for report in reports([(5, 100, 200)] * 4)][-1]
    wheels.restart()
    assert wheels.add(Report(5, 30_000, 12, 0, ())) is None
    assert wheels.add(Report(10, 30_000, 12, 0, ())).pose.tolist() == before.pose.tolist()


@given(st.floats(-1, 1), st.floats(-10, 10))
def test_targets_do_what_is_commanded_or_the_same_curve_more_slowly(speed_m_s, turn_rad_s):
    wheels = Wheels(SETTINGS)
    left, right = wheels.targets(speed_m_s, turn_rad_s)
    assert max(abs(left), abs(right)) <= LARGEST_TARGET
    wheels.add(Report(0, 0, 0, 0, ()))
    moved = wheels.add(Report(5, 5 * left % WRAP, 5 * right % WRAP, 0, ()))
    unit = 2 * 0.00034  # what rounding a target to whole units may change
    assert moved.speed_m_s * turn_rad_s == pytest.approx(moved.turn_rad_s * speed_m_s, abs=20 * unit)
    if max(abs(left), abs(right)) < LARGEST_TARGET:
        assert moved.speed_m_s == pytest.approx(speed_m_s, abs=unit)
        assert moved.turn_rad_s == pytest.approx(turn_rad_s, abs=unit / SETTINGS.track_m)


delays_ns = st.integers(0, 200_000_000)


@given(
    st.lists(st.tuples(st.sampled_from([5, 5, 5, 10, 40]), delays_ns), min_size=1, max_size=60), st.integers(0, 65535)
)
def test_stamps_only_grow_and_none_is_later_than_its_arrival(moves, beats):
    clock, true_ns, arrival_ns, before_ns = BeatClock(), 10**18, 0, 0
    for count, delay_ns in moves:
        beats, true_ns = beats + count, true_ns + count * 10_000_000
        arrival_ns = max(arrival_ns + 1, true_ns + delay_ns)  # a line keeps the order
        stamp_ns = clock.stamp_ns(beats % WRAP, arrival_ns)
        assert before_ns < stamp_ns <= arrival_ns
        before_ns = stamp_ns


@given(st.floats(0.99, 1.01), st.integers(0, 2**32 - 1))
def test_stamps_are_near_the_truth_though_messages_are_late(rate, seed):
    """Over a line that is late by up to 40 ms, and with a robot's clock that is wrong by a per cent."""
    rng, clock, arrival_ns, errors_s = np.random.default_rng(seed), BeatClock(), 0, []
    for report in range(400):
        true_ns = round(report * 50e6 * rate)
        arrival_ns = max(arrival_ns + 1, true_ns + int(rng.exponential(4e6)) % 40_000_000)
        if report % 100 == 50:
            arrival_ns += 150_000_000  # this computer had something else to do
        errors_s.append((clock.stamp_ns(5 * report % WRAP, arrival_ns) - true_ns) * 1e-9)
    late = np.array(errors_s[100:])
    assert np.quantile(np.abs(late), 0.9) < 0.02
    assert np.abs(late).max() < 0.05


def test_a_robot_that_was_silent_for_long_is_stamped_anew():
    clock = BeatClock()
    clock.stamp_ns(0, 10**9)
    assert clock.stamp_ns(5, 9 * 10**9) == 9 * 10**9


values = st.integers(1, 4505)


@given(st.lists(values, min_size=5, max_size=5))
def test_ranges_are_right_to_left_and_shrink_with_the_light(lights):
    found = ranges_m(lights, SETTINGS)
    assert (np.argsort(-found[::-1], kind="stable") == np.argsort(lights, kind="stable")).all()
    assert (found >= 0).all()
    assert np.isfinite(found).all()


def test_what_is_not_felt_is_infinitely_far_and_what_is_too_bright_is_touched():
    assert ranges_m([0, 9000, 4505, 0, 1], SETTINGS)[[0, 2, 3, 4]].tolist() == pytest.approx(
        [0.0854 * math.sqrt(4504), 0.0, 0.0, math.inf]
    )


@given(st.floats(0.03, 0.2), st.integers(100, 4400))
def test_a_sheet_of_paper_calibrates_the_curve(distance_m, value):
    settings = Thymio(proximity_half_m=half_m(distance_m, value, SETTINGS.proximity_peak))
    assert ranges_m([value], settings)[0] == pytest.approx(distance_m)


@pytest.mark.parametrize(("distance_m", "value"), [(0.1, 0), (0.1, 4505), (0.0, 2000), (0.1, 5000)])
def test_a_sheet_that_is_not_there_calibrates_nothing(distance_m, value):
    with pytest.raises(ValueError, match="hold something white"):
        half_m(distance_m, value, 4505)


@given(
    st.floats(0.0002, 0.0006),
    st.floats(0.9, 1.1),
    st.floats(0.08, 0.11),
    st.floats(0.5, 2.0),
    st.floats(1.5, 12.0),
)
def test_calibration_recovers_the_robot_that_drove(unit_m_s, ratio, track_m, metres, turns):
    left_m_s, right_m_s = unit_m_s * 2 / (1 + ratio), unit_m_s * 2 * ratio / (1 + ratio)
    robot = WheelOdometry(track_m)
    seconds = metres / 300 / unit_m_s
    straight, _ = robot.step(seconds, 300 * left_m_s, 300 * right_m_s)
    turned_rad = turns * 2 * math.pi
    spin_s = turned_rad * track_m / (200 * (left_m_s + right_m_s))
    if abs(straight[2]) > 1.0:
        return  # no tape can be held along such a circle
    found = solve(
        Leg(300 * seconds, 300 * seconds), straight[0], straight[1], Leg(-200 * spin_s, 200 * spin_s), turned_rad
    )
    assert found.speed_unit_m_s == pytest.approx(unit_m_s, rel=1e-6)
    assert found.left_scale == pytest.approx(2 / (1 + ratio), rel=1e-6)
    assert found.right_scale == pytest.approx(2 * ratio / (1 + ratio), rel=1e-6)
    assert found.track_m == pytest.approx(track_m, rel=1e-6)


@pytest.mark.parametrize(
    ("straight", "ahead_m", "spin", "turned_rad", "why"),
    [
        (Leg(3000, 3000), -1.0, Leg(-9000, 9000), 60.0, "got -1 m ahead"),
        (Leg(3000, 3000), 1.0, Leg(-9000, 9000), 0.1, "more than half a turn"),
        (Leg(0, 0), 1.0, Leg(-9000, 9000), 60.0, "no robot is like that"),
        (Leg(3000, 3000), 1.0, Leg(9000, -9000), 60.0, "no robot is like that"),
    ],
)
def test_a_drive_that_cannot_have_been_calibrates_nothing(straight, ahead_m, spin, turned_rad, why):
    with pytest.raises(ValueError, match=why):
        solve(straight, ahead_m, 0.0, spin, turned_rad)


def test_the_program_names_what_a_firmware_lacks():
    node = RemoteNode(1)
    with pytest.raises(Exception, match=r"prox\.horizontal|motor|_ev"):
        Assembler(node, firmware.program(1)).assemble()


# --- the line


@pytest.fixture
def line(tmp_path):
    """A serial port, and what its other end writes into."""
    try:
        master, slave = pty.openpty()
    except OSError as error:
        pytest.skip(f"no pseudo-terminal to be had ({error}): mount -t devpts devpts /dev/pts")
    tty.setraw(slave)
    port = tmp_path / "tty"
    port.symlink_to(os.ttyname(slave))
    yield str(port), master
    os.close(slave)
    os.close(master)


def test_a_message_that_is_none_is_told(line):
    port, other = line
    with Link(port, silence_s=0.2) as link:
        os.write(other, b"\xff\xff\x01\x00\x00\x00")
        with pytest.raises(LinkError, match="a message of 65535 bytes, which no Thymio sends: the line is out of step"):
            link.receive()
        os.write(other, b"\x02\x00\x01\x00\x01\x90\x00\x00")  # a variable's description, cut short
        with pytest.raises(LinkError, match="type 0x9001 that cannot be read"):
            link.receive()
        os.write(other, b"\x02\x00\x01")  # and nothing more
        with pytest.raises(LinkError, match=r"silent for 0.2 s"):
            link.receive()


def test_messages_may_come_in_pieces(line):
    port, other = line
    with Link(port) as link:
        data = b"\x06\x00\x07\x00\x00\x00\x01\x00\x02\x00\xff\xff"
        for byte in data:
            os.write(other, bytes([byte]))
        message = link.receive()
    assert (message.source_node, message.id, message.user_event_arg) == (7, 0, [1, 2, 0xFFFF])


def test_what_was_half_said_when_we_came_is_skipped(line):
    port, other = line
    os.write(other, b"\x34\x12\x78")
    with Link(port) as link:
        os.write(other, b"\x02\x00\x07\x00\x00\x00\x2a\x00")
        assert link.receive().user_event_arg == [42]


def test_two_robots_on_one_dongle_are_refused(line):
    port, other = line
    with Link(port, silence_s=0.2) as link:
        for node in (3, 9):
            os.write(other, b"\x02\x00" + bytes([node]) + b"\x00\x0c\x90\x05\x00")  # "I am here", protocol 5
        with pytest.raises(LinkError, match="2 robots answer there, expected one: switch the others off"):
            Firmware(link)


def test_without_a_port_the_first_thymio_or_dongle_is_taken(line, monkeypatch):
    port, _ = line
    others = [
        SimpleNamespace(device="/dev/ttyACM0", vid=0x2341, pid=0x0043),
        SimpleNamespace(device="/x", vid=None, pid=None),
    ]
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: others)
    with pytest.raises(LinkError, match="no Thymio and no Thymio dongle on USB"):
        Link("")
    others.append(SimpleNamespace(device=port, vid=0x0617, pid=0x000C))
    with Link("") as link:
        assert link.name == port


def test_a_port_that_is_not_there_or_held_by_another_is_told(line):
    with pytest.raises(LinkError, match="/dev/ttyACM77: not there: is the Thymio plugged in and on"):
        Link("/dev/ttyACM77")
    port, _ = line
    with Link(port), pytest.raises(LinkError, match="another program holds it"):
        Link(port)


# --- the camera


class Filmed:
    """A camera on a file, and what it handed on."""

    def __init__(self, source: str, **settings: float) -> None:
        self.stamps: list[int] = []
        self.pictures: list[np.ndarray] = []
        self.clock = HostClock()
        self.camera = camera.Camera(Thymio(camera=source, **settings), (20, 16), self.clock, self._take)

    def __enter__(self) -> "Filmed":
        self.camera.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.camera.close()

    def _take(self, t_ns: int, pixels: np.ndarray) -> None:
        self.stamps.append(t_ns)
        self.pictures.append(pixels)


def test_pictures_are_red_small_and_stamped_as_they_come(tmp_path):
    begin_ns = HostClock().now_ns()
    with Filmed(film(tmp_path / "film.avi", 60), camera_rate_hz=100) as filmed:
        until(lambda: len(filmed.pictures) >= 10, "pictures")
        assert filmed.camera.state == status.CAMERA_LIVE
        end_ns = filmed.clock.now_ns()
    stamps = np.array(filmed.stamps)
    assert begin_ns < stamps[0]
    assert stamps[9] < end_ns
    assert (np.diff(stamps) > 0).all()
    assert filmed.pictures[0].shape == (16, 20, 3)
    np.testing.assert_allclose(np.median(filmed.pictures[0].reshape(-1, 3), 0), RED, atol=25)


def test_no_more_pictures_a_second_than_wanted_and_earlier_by_the_delay(tmp_path):
    source = film(tmp_path / "film.avi", 90)
    with Filmed(source, camera_rate_hz=10, camera_delay_s=1.0) as filmed:
        until(lambda: len(filmed.pictures) >= 8, "pictures")
        newest_ns = filmed.clock.now_ns()
    gaps_s = np.diff(filmed.stamps) * 1e-9
    assert np.mean(gaps_s) > 0.09
    assert newest_ns - filmed.stamps[-1] >= 1_000_000_000


def test_a_camera_that_ends_is_told_and_opened_again(tmp_path):
    with Filmed(film(tmp_path / "film.avi", 5), camera_rate_hz=100) as filmed:
        until(lambda: "gives no more pictures" in filmed.camera.state, "its end")
        had = len(filmed.pictures)
        until(lambda: len(filmed.pictures) > had, "pictures after it")


def test_a_frozen_camera_is_told_and_its_pictures_are_kept_back(tmp_path):
    with Filmed(film(tmp_path / "film.avi", 200, still=True), camera_rate_hz=100, camera_frozen_s=0.5) as filmed:
        until(lambda: filmed.camera.state.startswith("frozen for"), "its word that it is frozen")
        had = len(filmed.pictures)
        until(lambda: filmed.camera.state.startswith("frozen for 2"), "more of it")
        assert len(filmed.pictures) == had > 0


def test_a_missing_camera_is_told_and_none_is_none(tmp_path):
    with Filmed("77") as filmed:
        until(lambda: "camera 77 is not there: plug it in, or name another" in filmed.camera.state, "its word")
    with Filmed(str(tmp_path / "nothing.avi")) as filmed:
        until(lambda: "cannot be opened" in filmed.camera.state, "its word")
    with Filmed("") as filmed:
        assert filmed.camera.state == status.CAMERA_NONE
    assert filmed.pictures == []


# --- the configuration


def test_the_robot_is_reached_otherwise_and_its_studies_are_the_same(tmp_path):
    """How a robot is reached is no part of what its results are known by."""
    text = Path("configs/thymio.toml").read_text()
    other = tmp_path / "thymio.toml"
    other.write_text(text + "\n[thymio]\nport = 'tcp/10.0.0.2:33333'\ntrack_m = 0.0935\n")
    assert load(other).thymio.track_m == 0.0935
    assert load(other).model_dump() == load("configs/thymio.toml").model_dump()


def test_without_the_extra_it_says_what_to_install(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda _name: None)
    with pytest.raises(RuntimeError, match=re.escape(install("thymio"))):
        options.need_thymio()
