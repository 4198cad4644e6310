"""What the dashboard costs while a browser watches, how often the browser is told, and how soon Stop stops.

A simulated Thymio at the pace of the wall's clock, its learner, perceiver, controller and dashboard, each a process of
its own, and a headless Chromium, all on the machine that is measured.
"""

import re
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest

from agents import messages, topics
from agents.robots.wire import ODOMETRY_TYPE
from agents.transport import Received, Session, free_endpoint, key, present, subscribe_stream
from bench.live import together
from bench.rows import Figure, Row
from tests.agents.browser import browser

CONFIG = Path("configs/thymio.toml")
ROBOT = "thymio"
AGENTS: dict[str, tuple[str, ...]] = {
    "perceiver": ("perceive",),
    "controller": ("control", "--behaviour", "walk"),
    "dashboard": ("dashboard", "--port", "0"),
    "robot": ("robot",),
}
WAIT_S = 60.0
#: Of the way's speed: below this the robot brakes, and so below that it stands [m/s].
BRAKES, STANDS_M_S = 0.9, 1e-3
FRAMES = """
() => new Promise((done) => {
  let count = 0;
  const end = performance.now() + 5000;
  const next = (now) => (now < end ? (count += 1, requestAnimationFrame(next)) : done(count / 5));
  requestAnimationFrame(next);
})
"""


class Speeds:
    """When the robot was sent which command, and how fast it went, by the machine's clock."""

    def __init__(self, session: Session) -> None:
        self.commands: list[tuple[float, tuple[float, float]]] = []
        self.speeds: list[tuple[float, float]] = []
        self._subscriptions = [
            subscribe_stream(session, key(ROBOT, topics.COMMAND), self._command),
            subscribe_stream(session, key(ROBOT, "odom"), self._odometry),
        ]

    def _command(self, message: Received) -> None:
        if message.sent is not None:
            twist = messages.read_twist(messages.decode(message.type, message.data))
            self.commands.append((message.sent.wall_ns / 1e9, twist))

    def _odometry(self, message: Received) -> None:
        if message.sent is not None:
            odometry: Any = messages.decode(ODOMETRY_TYPE, message.data)
            self.speeds.append((message.sent.wall_ns / 1e9, odometry.twist.twist.linear.x))

    def after(self, t_s: float, below: float) -> float:
        """Seconds from a time until the first odometry that says less."""
        end_s = time.monotonic() + WAIT_S
        while time.monotonic() < end_s:
            found = [at for at, speed in list(self.speeds) if at > t_s and abs(speed) < below]
            if found:
                return found[0] - t_s
            time.sleep(0.01)
        raise AssertionError(f"the robot was never slower than {below:g} m/s")


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Session, Any, Path]]:
    pytest.importorskip("starlette", reason="to measure the dashboard: pip install 'llrp-online[dashboard]'")
    folder = tmp_path_factory.mktemp("dashboard")
    learn = {"learner": ("learn", "--output", str(folder / "run"), "--json")}
    with browser() as chromium, together(CONFIG, folder, free_endpoint(), ROBOT, **learn, **AGENTS) as session:
        assert "dashboard" in present(session, ROBOT)
        log = folder / "dashboard.log"
        while not (found := re.search(r"http://\S+", log.read_text())):
            time.sleep(0.1)
        page = chromium.new_page(viewport={"width": 1400, "height": 950})
        page.goto(found.group())
        page.wait_for_selector("#thumbnails img", timeout=1000 * WAIT_S)  # by now it shows all that it can
        yield session, page, folder


def process_of(name: str) -> psutil.Process:
    """Of the agent that this process has started."""
    children = psutil.Process().children(recursive=True)
    return next(child for child in children if name in child.cmdline() and "agents.cli" in child.cmdline())


def test_what_watching_costs(world, record, short):
    _, page, _ = world
    blocks, block_s = (3, 5.0) if short else (6, 10.0)
    dashboard = process_of("dashboard")
    shares, intervals = [], []
    for _ in range(blocks):
        spent_s, told, start_s = (
            sum(dashboard.cpu_times()[:2]),
            page.evaluate("dashboard.link.frames"),
            time.monotonic(),
        )
        page.wait_for_timeout(1000 * block_s)
        took_s = time.monotonic() - start_s
        shares.append(100 * (sum(dashboard.cpu_times()[:2]) - spent_s) / took_s)
        intervals.append(took_s / (page.evaluate("dashboard.link.frames") - told))
    updates = 1 / Figure(intervals).median
    drawn = page.evaluate(FRAMES)
    note = f"at {updates:.1f} updates a second in one headless browser, which drew {drawn:.0f} frames a second"
    record(Row("dashboard, share of a core while a browser watches", Figure(shares), most=3.0, unit="%", note=note))
    record(Row("dashboard, between two updates in the browser", Figure(intervals), most=0.12, note="10 a second"))


def test_stop(world, record, short):
    session, page, _ = world
    heard = Speeds(session)
    commanded, braking, standing = [], [], []
    for _ in range(4 if short else 12):
        end_s = time.monotonic() + WAIT_S
        while not (len(heard.speeds) > 10 and min(speed for _, speed in heard.speeds[-5:]) > 0.1):
            assert time.monotonic() < end_s, "the robot never drives straight on"
            time.sleep(0.02)
        before = heard.speeds[-1][1]
        clicked_s = page.evaluate(
            "() => { const now = performance.timeOrigin + performance.now(); document.querySelector('#stop').click();"
            " return now / 1000; }"
        )
        braking.append(heard.after(clicked_s, BRAKES * before))
        standing.append(heard.after(clicked_s, STANDS_M_S))
        commanded.append(next(at for at, twist in heard.commands if at > clicked_s and twist == (0.0, 0.0)) - clicked_s)
        page.click("#release")
    note = f"n = {len(braking)}; the robot ticks every 50 ms"
    record(Row("Stop, from the click to a command to stand still", Figure(commanded), most=0.1, note=note))
    record(Row("Stop, from the click until odometry says that it brakes", Figure(braking), most=0.1, note=note))
    braked = "its wheels slow down by 0.5 m/s², so braking from 0.12 m/s itself takes 0.24 s"
    record(Row("Stop, from the click until it stands", Figure(standing), note=f"n = {len(standing)}; {braked}"))
