"""The real firmware machine, in the makers' simulator: bits, odometry, watchdogs and cables, against the truth."""

import os
import pty
import re
import select
import signal
import socket
import subprocess
import sys
import threading
import time
import tomllib
import tty
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pytest

from agents import messages, status, topics
from agents.intake import Intake
from agents.robots.thymio.firmware import Firmware
from agents.robots.thymio.link import Link, LinkError
from agents.transport import Frames, State, key, subscribe_state, subscribe_stream
from llrp_online.configuration import load
from llrp_online.events import OdometrySample, Reading
from replay.poses import wrap
from tests.agents.films import film
from tests.agents.playground import SCENES, SPEED_UNIT_M_S, TRACK_M, Playground, needs_playground
from tests.agents.playground_geometry import Scene
from tests.agents.processes import QUICK, ROOT, Processes, until

pytestmark = [pytest.mark.live, needs_playground]

TABLE = f"\n[thymio]\ncamera = ''\nspeed_unit_m_s = {SPEED_UNIT_M_S}\ntrack_m = {TRACK_M}\n"
REST_S = 2.0  # of wall time: longer than a command lives, by far
SPEED_M_S = 0.1


class Bench(Processes):
    """`llrp robot --kind thymio` as a process, what it says, and somebody who commands it."""

    def __init__(self, folder: Path, port: str, extra: str = "", replaced: Mapping[str, str] | None = None) -> None:
        config = folder / "thymio.toml"
        text = (ROOT / "configs" / "thymio.toml").read_text() + TABLE + extra
        for old, new in (replaced or {}).items():
            assert old in text
            text = text.replace(old, new)
        config.write_text(text)
        super().__init__(folder, config)
        self.odometry: list[tuple[float, OdometrySample]] = []  # with when it came, by the wall
        self.readings: list[Reading] = []
        self.status: status.ThymioStatus | None = None
        self.configuration = load(config)
        intake = Intake(self.configuration)

        def hear(message) -> None:
            for event in intake.events(message.key, message.type, message.data, 0):
                if isinstance(event, Reading):
                    self.readings.append(event)
                else:
                    self.odometry.append((time.time(), event))

        def hear_status(message) -> None:
            self.status = status.ThymioStatus(**status.decode(message.data))

        for name in ("odom", "range"):
            subscribe_stream(self.session, key("thymio", name), hear)
        subscribe_state(self.session, key("thymio", topics.ROBOT_STATUS), hear_status)
        self._commands = Frames(self.session, key("thymio", topics.COMMAND), topics.COMMAND_TYPE)
        self.start("robot", "robot", "--kind", "thymio", "--port", port)

    def said(self, name: str = "robot") -> str:
        return super().said(name)

    def wait_odometry(self, more: int = 10) -> None:
        had = len(self.odometry)
        until(lambda: len(self.odometry) >= had + more, f"odometry; {self.said('robot')}")

    def command(self, speed_m_s: float, turn_rad_s: float = 0.0) -> None:
        self._commands.put(messages.encode(messages.twist(speed_m_s, turn_rad_s)))

    def drive_until(self, true, speed_m_s: float = SPEED_M_S) -> None:
        def commanded() -> bool:
            self.command(speed_m_s)
            return true()

        until(commanded, "the drive's end")


@pytest.fixture(scope="module")
def arena(tmp_path_factory) -> Iterator[Playground]:
    with Playground(tmp_path_factory.mktemp("open"), "open") as playground:
        yield playground


@pytest.fixture
def corridor(tmp_path) -> Iterator[Playground]:
    with Playground(tmp_path, "corridor") as playground:
        yield playground


@pytest.fixture
def bench(arena, tmp_path) -> Iterator[Bench]:
    arena.put(1.0, 1.0, 0.0)
    with Bench(tmp_path, arena.port) as bench:
        bench.wait_odometry()
        yield bench


def moves(playground: Playground, seconds: float = 0.5) -> bool:
    before = playground.pose()
    time.sleep(seconds)
    return not np.allclose(playground.pose(), before, atol=1e-6)


def test_odometry_follows_the_true_pose(bench, arena):
    start = arena.pose()
    bench.drive_until(lambda: np.hypot(*(arena.pose() - start)[:2]) > 0.3)
    until(lambda: not moves(arena), "a stop")
    bench.wait_odometry()
    moved = relative(start, arena.pose())
    pose = bench.odometry[-1][1].pose
    assert moved[0] > 0.3
    np.testing.assert_allclose(pose, moved, atol=0.02)
    covariance = bench.odometry[-1][1].covariance
    assert np.linalg.eigvalsh(covariance).min() >= -1e-15
    assert covariance[0, 0] > 0


def test_reports_come_at_their_rates_in_order(bench):
    bench.wait_odometry(60)
    odometry = np.array([sample.t_ns for _, sample in bench.odometry])
    felt = np.array([reading.t_ns for reading in bench.readings])
    assert (np.diff(odometry) > 0).all()
    assert (np.diff(felt) > 0).all()
    # Twice as often: the sensors are read ten times a second, the wheels' sums come twenty times.
    assert len(odometry) / len(felt) == pytest.approx(2.0, rel=0.1)


def test_it_stops_when_commands_stop(bench, arena):
    start = arena.pose()
    bench.drive_until(lambda: np.hypot(*(arena.pose() - start)[:2]) > 0.05)
    time.sleep(REST_S)
    assert not moves(arena)


def test_it_stands_while_a_person_says_stop_whatever_is_commanded(bench, arena):
    start = arena.pose()
    bench.drive_until(lambda: np.hypot(*(arena.pose() - start)[:2]) > 0.05)
    button = State(bench.session, key("thymio", topics.STOP), topics.STOP_TYPE)
    button.put(messages.encode(messages.flag(True)))
    until(lambda: bench.status is not None and bench.status.stopped, "the robot's word that it stands")
    stood = arena.pose()
    for _ in range(20):
        bench.command(SPEED_M_S)
        time.sleep(0.05)
    assert np.hypot(*(arena.pose() - stood)[:2]) < 0.01
    button.put(messages.encode(messages.flag(False)))
    bench.drive_until(lambda: np.hypot(*(arena.pose() - stood)[:2]) > 0.05)


def test_it_stops_when_our_process_is_killed(bench, arena):
    start = arena.pose()
    bench.drive_until(lambda: np.hypot(*(arena.pose() - start)[:2]) > 0.05)
    bench.processes["robot"].kill()
    killed_at = arena.pose()
    time.sleep(REST_S)
    assert not moves(arena)
    # It lives on its last command for `transport.stale_s` at most, by its own clock.
    rolled_on_m = np.hypot(*(arena.pose() - killed_at)[:2])
    assert rolled_on_m < 1.2 * bench.configuration.transport.stale_s * SPEED_M_S


def test_ctrl_c_stops_the_motors_at_once(bench, arena):
    start = arena.pose()
    bench.drive_until(lambda: np.hypot(*(arena.pose() - start)[:2]) > 0.05)
    bench.processes["robot"].send_signal(signal.SIGINT)
    assert bench.processes["robot"].wait(30) == 0
    ended_at = arena.pose()
    assert not moves(arena)
    assert np.hypot(*(arena.pose() - ended_at)[:2]) < 0.2 * bench.configuration.transport.stale_s * SPEED_M_S
    assert re.search(r"0\.\d minutes, 0\.\d m", bench.said())
    assert "Traceback" not in bench.said()


def test_a_silent_robot_is_told_and_found_again(bench, arena):
    until(lambda: bench.status is not None and bench.status.link == "connected", "its word that it is connected")
    with arena.frozen():
        until(lambda: "silent for 1 s" in bench.status.link, "its word that the robot is silent")
    until(lambda: bench.status.link == "connected", f"another connection; {bench.said('robot')}")
    bench.wait_odometry()
    times_s = np.array([sample.t_ns for _, sample in bench.odometry]) * 1e-9
    assert np.diff(times_s).max() > bench.configuration.odometry.max_gap_s  # so the trajectory ends there
    assert "Thymio: connected" in bench.said()
    assert "Traceback" not in bench.said()


class Cable:
    """A serial port that leads to the playground: a pseudo-terminal, its name a link that comes and goes."""

    def __init__(self, name: Path, playground: Playground) -> None:
        self.name, self._tcp = name, playground.port.removeprefix("tcp/").split(":")
        self._pulled = threading.Event()

    def plug_in(self) -> None:
        self._pulled.clear()
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        self._robot = socket.create_connection((self._tcp[0], int(self._tcp[1])))
        self.name.symlink_to(os.ttyname(self._slave))
        self._thread = threading.Thread(target=self._carry, daemon=True)
        self._thread.start()

    def pull(self) -> None:
        self.name.unlink()
        self._pulled.set()
        self._thread.join()
        self._robot.close()
        os.close(self._slave)
        os.close(self._master)  # whoever reads at the other end gets an error, as from a USB port that is gone

    def _carry(self) -> None:
        while not self._pulled.is_set():
            ready, _, _ = select.select([self._master, self._robot], [], [], 0.02)
            if self._robot in ready:
                os.write(self._master, self._robot.recv(4096))
            if self._master in ready:
                self._robot.sendall(os.read(self._master, 4096))


@pytest.mark.slow
def test_a_serial_cable_may_be_pulled_and_plugged_in_again(arena, tmp_path):
    arena.put(1.0, 1.0, 0.0)
    cable = Cable(tmp_path / "ttyThymio", arena)
    with Bench(tmp_path, str(cable.name)) as bench:
        until(lambda: "not there: is the Thymio plugged in and on?" in bench.said(), "its word that none is there")
        cable.plug_in()
        bench.wait_odometry()
        start = arena.pose()
        bench.drive_until(lambda: np.hypot(*(arena.pose() - start)[:2]) > 0.05)
        cable.pull()
        until(lambda: "lost" in bench.status.link or "not there" in bench.status.link, "its word that it is gone")
        time.sleep(REST_S)
        assert not moves(arena)  # the robot stopped on its own
        cable.plug_in()
        bench.wait_odometry()
        here = arena.pose()
        bench.drive_until(lambda: np.hypot(*(arena.pose() - here)[:2]) > 0.05)
        bench.processes["robot"].send_signal(signal.SIGINT)
        assert bench.processes["robot"].wait(30) == 0
        assert "Traceback" not in bench.said()
        cable.pull()


def test_a_new_run_begins_from_nothing_and_a_halted_one_obeys_no_more(arena):
    arena.put(1.0, 1.0, 0.0)
    for _ in range(2):
        with Link(arena.port) as link:
            firmware = Firmware(link)
            first = firmware.report()
            assert (first.beats, first.left, first.right) == (5, 0, 0)
            firmware.drive(100, 100, 5.0)
            reports = [firmware.report() for _ in range(10)]
            assert reports[-1].left > 1000
            firmware.halt()
            firmware.drive(100, 100, 5.0)
            reports = [firmware.report() for _ in range(4)]
            assert len({report.left for report in reports}) == 1


def test_a_port_without_a_thymio_is_told(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as deaf:
        port = f"tcp/127.0.0.1:{deaf.getsockname()[1]}"
        with Link(port, silence_s=0.2) as link, pytest.raises(LinkError, match=r"silent for 0.2 s: is the Thymio on"):
            Firmware(link)
    with pytest.raises(LinkError, match="cannot be opened"):
        Link(port)


def relative(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Pose `b` as seen from pose `a`."""
    cos, sin = np.cos(a[2]), np.sin(a[2])
    dx, dy = (b - a)[:2]
    return np.array([cos * dx + sin * dy, -sin * dx + cos * dy, wrap(b[2] - a[2])])


def bits_at(bench: Bench, playground: Playground, pose: tuple[float, float, float]) -> list[int]:
    playground.put(*pose)
    had = len(bench.readings)
    until(lambda: len(bench.readings) > had + 3, "readings from there")
    return bench.readings[-1].bits.tolist()


@pytest.mark.slow
def test_bits_in_a_corridor_and_in_the_open(corridor, tmp_path):
    with Bench(tmp_path, corridor.port) as bench:
        bench.wait_odometry()
        assert bits_at(bench, corridor, (0.30, 0.50, 0.0)) == [0, 0, 0, 0, 0]  # in the open
        assert bits_at(bench, corridor, (1.20, 0.50, 0.0)) == [1, 0, 0, 0, 1]  # in the middle of the corridor
        assert bits_at(bench, corridor, (1.20, 0.50, np.pi)) == [1, 0, 0, 0, 1]
        assert bits_at(bench, corridor, (1.20, 0.50, np.pi / 2)) == [1, 1, 1, 1, 1]  # across it
        assert bits_at(bench, corridor, (2.45, 0.50, 0.0))[1:4] == [1, 1, 1]  # a wall 7 cm before its nose
        assert bits_at(bench, corridor, (2.36, 0.50, 0.0)) == [0, 0, 0, 0, 0]  # 16 cm
        assert bits_at(bench, corridor, (1.85, 0.50, 0.0)) == [1, 1, 1, 1, 1]  # at its closed end
        assert bits_at(bench, corridor, (0.30, 0.75, np.pi / 4)) == [0, 0, 0, 0, 0]
        compare_bits(bench, corridor, "corridor", ((0.1, 2.5), (0.41, 0.59)))


def test_bits_near_posts_and_walls_of_an_open_arena(bench, arena):
    compare_bits(bench, arena, "open", ((0.1, 1.9), (0.1, 1.9)))


def compare_bits(bench: Bench, playground: Playground, name: str, region: tuple) -> None:
    """At places drawn at random, half of them near something, each bit is what geometry says where that is clear."""
    scene, rng = Scene(SCENES / f"{name}.playground"), np.random.default_rng(0)
    seen = {0: 0, 1: 0}
    wanted = [True, False] * 8
    while wanted:
        pose = np.array([rng.uniform(*region[0]), rng.uniform(*region[1]), rng.uniform(-np.pi, np.pi)])
        rays_m = scene.rays_m(pose)
        if not scene.is_free(*pose[:2]) or (rays_m.min() < 0.08) != wanted[-1]:
            continue
        wanted.pop()
        bits = bits_at(bench, playground, tuple(pose))
        for sensor, bit in enumerate(bits):
            # Where a sensor's edge leaves what it reaches (14 cm), the simulator's own curve jumps: a wall seen askance
            # may be as good as touched. So all of what a sensor sees is to be within its reach, or all beyond it.
            least_m, most_m = rays_m[sensor].min(), rays_m[sensor].max()
            near, far = most_m < 0.085, least_m > 0.145 or 0.115 < least_m < most_m < 0.138
            if near or far:
                assert bit == int(near), (pose, sensor, rays_m[sensor])
                seen[bit] += 1
    assert min(seen.values()) >= 6, seen


class Answers:
    """Somebody at the terminal of `llrp calibrate`, who reads a tape measure that does not lie."""

    def __init__(self, config: Path, port: str) -> None:
        words = [sys.executable, "-m", "agents.cli", "calibrate", "--config", str(config), "--port", port]
        words += ["--metres", "0.4", "--turns", "2"]
        self.process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=ROOT)
        self.said = b""

    def when(self, question: str, answer: str = "") -> None:
        self.until(question)
        self.write(answer)

    def write(self, answer: str) -> None:
        self.process.stdin.write(f"{answer}\n".encode())
        self.process.stdin.flush()

    def until(self, question: str) -> None:
        while question.encode() not in self.said:
            letter = self.process.stdout.read(1)
            assert letter, self.said.decode()
            self.said += letter
        self.said = b""


@pytest.mark.slow
def test_calibration_finds_the_simulators_own_figures(arena, tmp_path):
    arena.put(0.4, 1.0, 0.0)
    answers = Answers(ROOT / "configs" / "thymio.toml", arena.port)
    try:
        answers.when("Enter, and it begins.")
        answers.until("along the tape, in metres?")
        ahead, aside, _ = arena.pose() - [0.4, 1.0, 0.0]
        answers.write(f"{ahead:.4f}")
        answers.when("left positive?", f"{aside:.4f}")
        arena.put(1.0, 1.0, 0.0)
        answers.when("Enter, and it begins.")
        answers.until("past 2 whole turns")
        past = np.rad2deg(wrap(arena.pose()[2]))
        answers.when("?", f"{past:.1f}".replace(".", ","))  # some write a comma
        arena.put(2.0 - 0.10 - 0.0795, 1.0, 0.0)
        answers.when("Enter, and it begins.")
        answers.process.stdin.close()
        table = tomllib.loads(answers.process.stdout.read().decode().partition("file:")[2])["thymio"]
        assert answers.process.wait(30) == 0
    finally:
        answers.process.kill()
        answers.process.wait()
        answers.process.stdout.close()
    assert table["speed_unit_m_s"] == pytest.approx(SPEED_UNIT_M_S, rel=0.01)
    assert table["track_m"] == pytest.approx(TRACK_M, rel=0.01)
    assert table["left_scale"] == pytest.approx(1.0, abs=0.01)
    assert table["right_scale"] == pytest.approx(1.0, abs=0.01)
    assert table["proximity_half_m"] == pytest.approx(0.0854, rel=0.03)


MINUTES = 2.0


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_two_minutes_of_exploring(arena, tmp_path, capsys):
    """Odometry against the robot's own position all the way; bits against geometry are held in tests of their own."""
    arena.put(1.0, 1.0, 0.0)
    with Bench(tmp_path, arena.port) as bench:
        bench.wait_odometry()
        start, begin_ns = arena.pose(), bench.odometry[-1][1].t_ns
        bench.start("controller", "control", "--behaviour", "explore", "--seed", "0")
        truth: list[tuple[float, np.ndarray]] = []
        while bench.odometry[-1][1].t_ns - begin_ns < MINUTES * 60e9:
            before_s = time.time()
            pose = arena.pose()
            truth.append(((before_s + time.time()) / 2, pose))
            time.sleep(0.1)
            assert bench.processes["robot"].poll() is None, bench.said()
            assert bench.processes["controller"].poll() is None, bench.said("controller")
        bench.processes["controller"].send_signal(signal.SIGINT)
        assert bench.processes["controller"].wait(30) == 0
        figures = compared(truth, bench.odometry, start)
        felt = np.array([reading.bits for reading in bench.readings])
    with capsys.disabled():
        print("\n" + ", ".join(f"{name} {value:.3f}" for name, value in figures.items()))
    assert figures["way_m"] > 5
    assert (felt == 1).any(1).sum() > 50
    assert figures["error_of_way"] < 0.05
    assert figures["way_ratio"] == pytest.approx(1.0, abs=0.05)
    assert figures["heading_error_of_turn"] < 0.05


def compared(truth: list, odometry: list, start: np.ndarray) -> dict[str, float]:
    """Odometry beside the truth, sample by sample as they came."""
    arrived_s = np.array([came for came, _ in odometry])
    said = np.array([sample.pose for _, sample in odometry])
    at = [int(np.abs(arrived_s - t_s).argmin()) for t_s, _ in truth]
    true = np.array([relative(start, pose) for _, pose in truth])
    guess = np.array([relative(said[at[0]], pose) for pose in said[at]])
    ways = {name: np.hypot(*np.diff(poses[:, :2], axis=0).T) for name, poses in (("true", true), ("guess", guess))}
    # The true heading trembles too, which adds up to turns that are none; what odometry turned is the stricter measure.
    turned_rad = np.concatenate([[0], np.cumsum(np.abs(wrap(np.diff(guess[:, 2]))))])
    way_m = np.concatenate([[0], np.cumsum(ways["true"])])
    error_m = np.hypot(*(guess - true)[:, :2].T)
    bent_rad = np.abs(wrap(guess[:, 2] - true[:, 2]))
    after = (way_m > 1.0) & (turned_rad > np.pi)  # of less, the moment between two samples is more than a per cent
    return {
        "way_m": way_m[-1],
        "error_at_the_end_m": error_m[-1],
        "largest_error_m": error_m.max(),
        "error_of_way": (error_m[after] / way_m[after]).max(),
        "way_ratio": ways["guess"].sum() / ways["true"].sum(),
        "turned_rad": turned_rad[-1],
        "largest_heading_error_rad": bent_rad.max(),
        "heading_error_of_turn": (bent_rad[after] / turned_rad[after]).max(),
    }


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_learner_perceiver_and_controller_work_as_with_the_simulated_robot(arena, tmp_path):
    """All agents on the real robot's messages, its camera a film: labels come, weights, predictions."""
    arena.put(1.0, 1.0, 0.0)
    source = film(tmp_path / "film.avi", 300)
    words = {"width = 80": "width = 20", "height = 64": "height = 16", "window_s = 30.0": "window_s = 4.0"}
    counts = dict.fromkeys(("labels", "prediction", topics.WEIGHTS), 0)
    with Bench(tmp_path, arena.port, QUICK, {**words, "camera = ''": f"camera = '{source}'"}) as bench:
        for name in counts:
            subscribe_stream(
                bench.session, key("thymio", name), lambda _, name=name: counts.update({name: counts[name] + 1})
            )
        bench.start("learner", "learn", "--output", str(tmp_path / "run"))
        bench.start("perceiver", "perceive")
        bench.start("controller", "control", "--behaviour", "explore")
        until(lambda: all(count > 5 for count in counts.values()), f"all of {counts}", 200)
        for name in ("learner", "perceiver", "controller", "robot"):
            bench.processes[name].send_signal(signal.SIGINT)
            assert bench.processes[name].wait(60) == 0, bench.said(name)
            assert "Traceback" not in bench.said(name)
