"""Why is it not learning? Robots that each lack something, and what the page of each says, in a real browser.

All of them live at once, on one bus: a thread says their messages, of the real types, and each has a dashboard.
"""

import threading
import time
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from agents import messages
from agents.agent import Agent
from agents.dashboard.button import StopButton
from agents.extras import install
from agents.naming import naming_of
from agents.transport import free_endpoint, open_session
from llrp_online.configuration import RobotConfiguration, load
from tests.agents.browser import Watcher, browser
from tests.agents.processes import until
from tests.agents.scripted import A_TICK, Learner, WatchedRobot

pytest.importorskip("starlette", reason=f"to test the dashboard: {install('dashboard')}")
pytestmark = pytest.mark.live

THYMIO = load("configs/thymio.toml")
PLOTS = ("auc", "loss", "yield")
#: No frame gets its first label.
STUCK = replace(A_TICK, labelled=0, remembered=0, known=[0, 0], positives=[0, 0], steps=0, version=None)


def minute(number: int, **more: Any) -> dict[str, Any]:
    """A robot minute, as a learner answers it."""
    bands: list[dict[str, float]] = []
    for near_m in (0.0, 0.1, 0.2):
        auc = 0.8 + 0.02 * number - near_m
        score = {"auc": auc, "low": auc - 0.1, "high": auc + 0.1}
        bands.append({"low_m": near_m, "high_m": near_m + 0.1, **score, "n_pos": 90, "n_neg": 900, "log_loss": 0.2})
    told = {"start_s": 60.0 * (number - 1), "end_s": 60.0 * number, "frames": 600, "known": 9300 * number}
    counted = {"positives": 500, "steps": 300, "loss": 0.5 / number, "version": 0, "published": 0, "rejected": 0}
    return {**told, **counted, "bands": bands, **more}


QUIET: dict[str, Any] = {"minutes": [minute(number) for number in range(1, 6)], "drift_events": []}
#: The same, and in the second minute weights that pass, in the fourth some that do not, and a change of the world.
LIVELY = {
    "minutes": [minute(number, published=int(number == 2), rejected=int(number == 4)) for number in range(1, 6)],
    "drift_events": [{"robot_s": 150.0, "band": 0}],
}


@dataclass
class Case:
    """A robot that lacks something.

    Attributes:
        cause, grade: what the page is to name it, and how bad.
        said: words of the page.
        lacks: of "odom", "camera", "range", what does not come.
        labels: keys of the configuration's table that are changed.
        targets: the same.
        learner: what its learner's status grows by with each tick; None: there is none.
        sees: the grey of the picture at a tick.
        goes: the way driven until a tick [m].
    """

    cause: str
    grade: str
    said: str
    lacks: str = ""
    labels: dict[str, Any] | None = None
    targets: dict[str, Any] | None = None
    learner: Any = A_TICK
    sees: Callable[[int], int] = lambda tick: tick % 256
    goes: Callable[[int], float] = lambda tick: 0.0203 * tick

    @property
    def robot(self) -> str:
        return self.cause.replace(" ", "_")

    def configuration(self) -> RobotConfiguration:
        changed = {
            "labels": THYMIO.labels.model_copy(update=self.labels or {}),
            "targets": THYMIO.targets.model_copy(update=self.targets or {}),
            "robot": THYMIO.robot.model_copy(update={"name": self.robot}),
        }
        return THYMIO.model_copy(update=changed)


CASES = [
    Case("learning", "fine", "It is learning: version 1"),
    Case("no learner", "stops", "llrp learn", learner=None),
    Case("odometry missing", "stops", "Nothing has come on odom. Without poses", lacks="odom"),
    Case("camera missing", "stops", "Nothing has come on camera/image/compressed", lacks="camera"),
    Case("short range missing", "stops", "Nothing has come on range", lacks="range"),
    Case("camera frozen", "stops", "has sent the same picture for", sees=lambda _: 7),
    Case("odometry unusable", "stops", "odom: ", goes=lambda _: float("nan")),
    Case("standing still", "stops", "the robot hardly moves", learner=STUCK, goes=lambda _: 1.0),
    Case(
        "window too short",
        "stops",
        "Raise labels.window_s",
        labels={"window_s": 0.5},
        targets={"start_m": 0.25},
        learner=STUCK,
    ),
    Case(
        "tolerance too tight",
        "stops",
        "Raise labels.position_tolerance_m",
        labels={"position_tolerance_m": 1e-5},
        learner=STUCK,
    ),
    Case("no labels", "stops", "Do their clocks agree?", learner=STUCK),
    Case("one class only", "stops", "0 say that a sensor felt something", learner=replace(A_TICK, positives=[0, 0])),
    Case("throttled", "slows", "the learner cannot keep up", learner=replace(A_TICK, let_go=4.0)),
    Case("rejected by the gate", "slows", "judged worse on held-out frames", learner=replace(A_TICK, rejected=1)),
]


class Life:
    """A robot, its learner and its dashboard; `step` is a tenth of a second of it."""

    def __init__(self, case: Case, session: Any, stack: ExitStack, folder: Any) -> None:
        from agents.dashboard.server import Dashboard

        self.case, configuration = case, case.configuration()
        agent = Agent(session, case.robot, threading.Event())
        self.robot = WatchedRobot(configuration, agent)
        stack.callback(self.robot.collector.close)
        self.learner = None
        if case.learner is not None:
            memory = {"frames": 0, "sizes": {"recent": 0, "memory": 0}, "counts": [[[0, 0]]], "pictures": []}
            self.learner = Learner(agent, case.learner, {"curves": QUIET, "memory": memory})
            stack.callback(self.learner.close)
        button = StopButton(agent, configuration, lambda: self.robot.t_ns)
        dashboard = Dashboard(self.robot.collector, button, "127.0.0.1", 0, folder)
        self.port = stack.enter_context(dashboard).port

    def step(self) -> None:
        robot, case = self.robot, self.case
        if "odom" in case.lacks:
            robot.tick += 1
        else:
            robot.drive(case.goes(robot.tick + 1))
        if "camera" not in case.lacks:
            robot.picture(case.sees(robot.tick))
        if "range" not in case.lacks:
            robot.say(
                "range", messages.laser_scan(robot.t_ns, [0.08, np.inf, np.inf, np.inf, 0.2], (-0.7, 0.7), (0.0, 0.3))
            )
        if self.learner is not None and robot.tick % 10 == 0:
            self.learner.say(robot.tick)


@pytest.fixture(scope="module")
def lives(tmp_path_factory):
    over, folder = threading.Event(), tmp_path_factory.mktemp("saved")
    with ExitStack() as stack:
        session = stack.enter_context(open_session(free_endpoint(), name="robots", naming=naming_of(THYMIO)))
        found = {case.cause: Life(case, session, stack, folder) for case in CASES}

        def live() -> None:
            while not over.is_set():
                begun_s = time.monotonic()
                for life in found.values():
                    life.step()
                over.wait(max(0.0, 0.1 - (time.monotonic() - begun_s)))

        thread = threading.Thread(target=live, name="robots")
        thread.start()
        stack.callback(thread.join)
        stack.callback(over.set)
        yield found


@pytest.fixture(scope="module")
def watcher(lives):
    with browser() as chromium:
        yield Watcher(chromium)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.cause)
def test_the_page_names_the_cause_and_what_to_do(lives, watcher, case):
    watcher.port = lives[case.cause].port
    watcher.page = watcher.open(viewport={"width": 1400, "height": 950})
    try:
        item = f"#findings li.{case.grade}[data-cause='{case.cause}']"
        watcher.page.wait_for_selector(item)
        assert case.said in watcher.text(item)
        fine = case.grade == "fine"
        assert watcher.page.locator(f"{item} .do").count() == (0 if fine else 1)
        assert watcher.text("#why-title") == ("Is it learning?" if fine else "Why is it not learning?")
        # The first of the list is the worst; nothing else that stops learning is named beside it.
        named = watcher.page.eval_on_selector_all("#findings .stops", "all => all.map((one) => one.dataset.cause)")
        assert named == ([case.cause] if case.grade == "stops" else [])
        assert watcher.faults == []
    finally:
        watcher.page.close()


def test_curves_have_their_lines_intervals_and_marks(lives, watcher):
    life = lives["learning"]
    watcher.port = life.port
    watcher.page = watcher.open(viewport={"width": 1400, "height": 950}, color_scheme="light")

    def pixels(plot: str, colour: str) -> np.ndarray:
        return watcher.where(f"#{plot} canvas", colour)

    def columns(plot: str, colour: str) -> Counter[float]:
        return Counter(pixels(plot, colour)[:, 0].tolist())

    try:
        watcher.until("document.querySelectorAll('#curves-table tbody tr').length === 5", "five minutes")
        assert "0.840 [0.74 0.94]" in watcher.page.text_content("#curves-table tbody tr:nth-child(2)")
        for band in range(3):
            until(lambda name=f"series-{band}": len(pixels("auc", name)), "the line of each band")
        width, height = watcher.page.eval_on_selector("#auc canvas", "e => [e.width, e.height]")
        for plot in ("loss", "yield"):
            assert len(columns(plot, "series-0")) > 0.5 * width
        assert watcher.page.get_attribute("#loss", "aria-label") == "Training loss, last: 0.100."
        assert watcher.page.get_attribute("#yield", "aria-label") == "Known labels in the last minute: 46500."
        assert not any(len(pixels(plot, "bad")) for plot in PLOTS)
        quiet = len(pixels("auc", "quiet"))

        life.learner.answers["curves"] = LIVELY
        watcher.until("document.querySelector('#curves-said').textContent.includes('1 drift event')", "the change")
        for plot in PLOTS:
            tall = [x for x, count in columns(plot, "bad").items() if count > 0.6 * height]
            assert 1 <= len(tall) <= 3
            assert 0.5 < np.mean(tall) < 0.65  # of five minutes, in the middle of the third
        rejected = [x for x, count in columns("auc", "bad").items() if count < 0.2 * height]
        assert 0.65 < np.mean(rejected) < 0.8
        assert len(pixels("auc", "quiet")) > quiet  # weights that passed
        assert watcher.faults == []
    finally:
        watcher.page.close()
