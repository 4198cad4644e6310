"""The dashboard of a robot with three cameras, a grid of targets around it, and a window that closes with drift.

The Pioneer's own configuration, made quick: a real learner and a real dashboard, each a process of its own; the robot
and its predictions are a test's, so that what is to be drawn where is known.
"""

import re
import threading

import numpy as np
import pytest

from agents import messages, topics
from agents.agent import Agent
from agents.extras import install
from llrp_online.configuration import load
from tests.agents.browser import Watcher, browser
from tests.agents.processes import ROOT, Agents, until
from tests.agents.robots import sonar
from tests.agents.scripted import TICK_NS, Robot

pytest.importorskip("starlette", reason=f"to test the dashboard: {install('dashboard')}")
pytestmark = pytest.mark.live

#: Its clock runs so many times as fast as the wall's.
FASTER = 8
SPEED_M_S, WINDOW_S, GATE_M = 0.5, 30.0, 0.05
#: Targets that the test expects something at: far ahead, and far behind on the left.
EXPECTED = [(5.0, 0.0), (-3.0, 4.0)]


def quick_pioneer(folder):
    text = (ROOT / "configs" / "pioneer.toml").read_text()
    for old, new in {
        "width = 80": "width = 20",
        "height = 64": "height = 16",
        'window = "fixed"': f'window = "drift"\ngate_m = {GATE_M}',
        "window_s = 60.0": f"window_s = {WINDOW_S}",
        "[training]": "[publishing]\nevery_s = 0.5\n[training]\nbatch = 8\nwarmup_frames = 8",
    }.items():
        assert old in text
        text = text.replace(old, new)
    path = folder / "pioneer.toml"
    path.write_text(text)
    return path


class Pioneer(Robot):
    """Turns at random over a floor of dark and bright squares, two metres wide."""

    def __init__(self, configuration, agent):
        super().__init__(configuration, agent)
        self._rng = np.random.default_rng(0)
        self._x_m = self._y_m = self._yaw_rad = self._turn = 0.0
        targets = configuration.targets.build().poses
        self._targets, self._sensors = targets, configuration.sensors
        self._expected = np.zeros((len(targets), 1))
        for x_m, y_m in EXPECTED:
            self._expected[np.flatnonzero((targets[:, 0] == x_m) & (targets[:, 1] == y_m))] = 1.0
        assert self._expected.sum() == len(EXPECTED)

    def step(self):
        if self.tick % 30 == 0:
            self._turn = self._rng.uniform(-0.5, 0.5)
        step_s = TICK_NS * 1e-9
        self._yaw_rad += self._turn * step_s
        self._x_m += SPEED_M_S * step_s * np.cos(self._yaw_rad)
        self._y_m += SPEED_M_S * step_s * np.sin(self._yaw_rad)
        self.drive(self._x_m, self._y_m, self._yaw_rad)
        dark = (np.floor(self._x_m) + np.floor(self._y_m)) % 4 < 2
        self.say("range", sonar(self.t_ns, 0.2 if dark else 0.8))
        for camera in self.configuration.camera:
            pixels = self._rng.integers(0, 255, (16, 20, 3)).astype(np.uint8)
            self.say(camera.topic, messages.compressed_image(self.t_ns, pixels), frames=True)
        cloud = messages.prediction(self.t_ns, self._targets, self._sensors, self._expected)
        self.say(topics.PREDICTION, cloud, frames=True)


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    folder, over = tmp_path_factory.mktemp("grid"), threading.Event()
    config = quick_pioneer(folder)
    with browser() as chromium, Agents(folder, config) as agents:
        pioneer = Pioneer(load(config), Agent(agents.session, "pioneer", over))

        def live():
            while not over.wait(TICK_NS * 1e-9 / FASTER):
                pioneer.step()

        agents.start("learner", "learn", "--output", str(folder / "run"), "--json")
        port = agents.start_dashboard()
        agents.wait_present("learner", "dashboard")
        thread = threading.Thread(target=live, name="pioneer")
        thread.start()
        try:
            watcher = Watcher(chromium)
            watcher.port = port
            watcher.page = watcher.open(viewport={"width": 1400, "height": 950}, color_scheme="light")
            yield watcher
            assert watcher.faults == []
        finally:
            over.set()
            thread.join()


def test_each_camera_is_shown(world):
    world.until("document.querySelectorAll('#cameras img').length === 3", "three pictures")
    for camera in (1, 2, 3):
        selector = f"#cameras img:nth-child({camera})"
        world.until(f"document.querySelector('{selector}').naturalWidth === 20", "a picture")
        world.until_it_changes(selector)
    assert len({world.picture(f"#cameras img:nth-child({camera})") for camera in (1, 2, 3)}) == 3


def test_predictions_of_a_grid_are_seen_from_above(world):
    world.until("document.querySelector('#prediction-said').textContent.startsWith('Expected of this')", "a prediction")
    world.until(
        "document.querySelector('#prediction').ariaLabel === 'Expects to feel something: floor at 5.00 m.'", "in words"
    )
    until(lambda: len(world.where("#prediction", "predicted-2")), "what is expected")
    certain = world.where("#prediction", "predicted-2")
    # Ahead is up and left is left: one square on top, in the middle; one at the bottom, on the left.
    top, low = certain[certain[:, 1] < 0.3], certain[certain[:, 1] > 0.6]
    assert len(top) + len(low) == len(certain)
    assert abs(top[:, 0].mean() - 0.5) < 0.03
    assert low[:, 0].max() < top[:, 0].min() - 0.15
    assert len(top) == pytest.approx(len(low), rel=0.2)


def test_labels_of_a_grid_fill_in_and_are_explained(world):
    shares = (
        "[...document.querySelectorAll('#film .said')]"
        ".map((said) => parseInt(/(\\d+) % known/.exec(said.textContent)?.[1] ?? 0))"
    )
    world.until(f"{shares}.some((share) => share >= 2)", "labels")
    keys = world.page.eval_on_selector_all("#film li[data-key]", "all => all.map((one) => one.dataset.key)")
    known = dict(zip(keys, world.page.evaluate(shares), strict=False))
    best = max(known, key=known.__getitem__)
    maps = f"#film li[data-key='{best}'] canvas:nth-of-type(2)"
    world.page.locator(maps).scroll_into_view_if_needed()
    until(lambda: len(world.where(maps, "positive")) + len(world.where(maps, "negative")), "the labels are drawn")
    world.page.click(f"#film li[data-key='{best}'] button")
    world.until("document.querySelectorAll('#explain-body tbody tr').length > 0", "reasons")
    assert world.page.locator("#explain-body img").count() == 3
    labels, total = map(int, re.search(r"(\d+) of (\d+) labels are known", world.text("#explain-body > p")).groups())
    assert total == 17 * 17
    rows = world.page.locator("#explain-body tbody tr")
    assert rows.count() == labels
    cells = rows.first.locator("td").all_inner_texts()
    assert re.fullmatch(r"-?\d\.\d\d, -?\d\.\d\d m", cells[0])
    assert float(cells[4].removesuffix(" mm")) <= 100.0
    assert 0 < float(cells[6].removesuffix(" mm")) <= 1000 * GATE_M
    world.page.keyboard.press("Escape")
    world.page.wait_for_selector("#explain", state="hidden")


def test_the_window_that_drift_closes_and_its_ellipse_are_drawn(world):
    world.until(
        "document.querySelector('#map-said').textContent.includes('until its pose is known to 5.0 cm only')", "it"
    )

    def back_s():
        return float(re.search(r"reaches (\d+) s back", world.text("#map-said")).group(1))

    until(lambda: back_s() >= 3, "a window of seconds")
    spread_mm = float(re.search(r"known to (\d+\.\d) mm", world.text("#map-said")).group(1))
    assert 0 < spread_mm <= 2000 * GATE_M + 0.1
    world.until("document.querySelectorAll('#film li').length > 20", "more time passes than the longest window")
    assert back_s() < WINDOW_S
    assert len(world.where("#map", "ellipse"))
    assert len(world.where("#map", "window"))


def test_what_the_memory_holds_is_drawn_from_above(world):
    world.until("document.querySelectorAll('#thumbnails img').length >= 8", "thumbnails")
    # The three cameras' pictures side by side.
    world.until("document.querySelector('#thumbnails img').naturalWidth === 60", "their pictures")
    world.until(
        "/[1-9]\\d* felt nothing, [1-9]\\d* felt something/.test(document.querySelector('#counts').ariaLabel)", "both"
    )
    bright, dark = world.where("#counts", "negative"), world.where("#counts", "positive")
    assert len(bright)
    assert len(dark)
    assert np.concatenate([bright, dark])[:, 1].max() < 0.95
