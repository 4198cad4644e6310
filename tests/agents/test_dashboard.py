"""The dashboard in a real browser, beside a robot that learns: pictures change, curves grow, buttons reach the agents.

With `--screenshots FOLDER` the pictures of the docs are taken on the way, of the Thymio's own configuration.
"""

import http.client
import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from agents.extras import install
from llrp_online import checkpoint
from tests.agents.browser import Watcher, browser
from tests.agents.processes import ROOT, WAIT_S, Agents, quick_configuration, until

pytest.importorskip("starlette", reason=f"to test the dashboard: {install('dashboard')}")
pytestmark = [pytest.mark.live, pytest.mark.timeout(600)]


class World(Watcher):
    """A robot that learns, its dashboard, and a page on it."""

    def __init__(self, agents, chromium, screenshots):
        super().__init__(chromium, screenshots)
        self.agents = agents

    def start_dashboard(self):
        self.port = self.agents.start_dashboard(self.port, "--save-to", str(self.agents.folder / "saved"))


@pytest.fixture(scope="module")
def world(tmp_path_factory, request):
    folder = tmp_path_factory.mktemp("dashboard")
    wanted = request.config.getoption("--screenshots")
    config = quick_configuration(folder) if wanted is None else ROOT / "configs" / "thymio.toml"
    with browser() as chromium, Agents(folder, config) as agents:
        world = World(agents, chromium, None if wanted is None else Path(wanted))
        world.start_dashboard()
        for name, words in {
            "learner": ("learn", "--output", str(folder / "run"), "--json"),
            "perceiver": ("perceive",),
            "controller": ("control", "--behaviour", "explore"),
            "robot": ("robot", "--speed", "4"),
        }.items():
            agents.start(name, *words)
        agents.wait_present("learner", "perceiver", "controller", "robot", "dashboard")
        world.page = world.open(viewport={"width": 1400, "height": 950})
        until(lambda: agents.learner is not None and agents.learner.version is not None, "weights")
        yield world


def test_the_picture_and_what_is_expected_of_it_change(world):
    world.until("document.querySelector('#cameras img')?.naturalWidth > 0", "a picture")
    assert world.page.eval_on_selector("#cameras img", "e => e.naturalWidth") >= 20
    world.until("document.querySelector('#prediction-said').textContent.startsWith('Expected of this')", "a prediction")
    world.until_it_changes("#cameras img")
    world.until_it_changes("#prediction")
    world.until("document.querySelector('#prediction').ariaLabel.startsWith('Expects to feel')", "it in words")
    assert world.page.locator("#agents li:not(.gone)").count() == 4
    assert world.faults == []


def test_labels_of_past_frames_fill_in(world):
    world.until("document.querySelectorAll('#film li[data-key]').length >= 4", "past frames")
    first = {}

    def grown():
        now = frames_of_film(world)
        first.update({key: frame for key, frame in now.items() if key not in first})
        return [k for k, (known, labels, _) in now.items() if known > first[k][0] and labels != first[k][1]]

    until(grown, "labels of a frame that became known, and were drawn")
    until(lambda: all(width >= 20 for _, _, width in frames_of_film(world).values()), "their pictures")
    world.until(
        "[...document.querySelectorAll('#film .said')].some(e => e.textContent.endsWith('final'))", "a window closes"
    )


def frames_of_film(world):
    """Key -> share of the labels known [%], the map of them, the width of the picture; of the newest frames."""
    return world.page.evaluate(
        "Object.fromEntries([...document.querySelectorAll('#film li[data-key]')].slice(0, 8).map(e => [e.dataset.key, ["
        "parseInt(/(\\d+) % known/.exec(e.textContent)?.[1] ?? 0), e.querySelectorAll('canvas')[1].toDataURL(),"
        " e.querySelector('img').naturalWidth]]))"
    )


def test_the_map_shows_path_window_and_how_well_the_pose_is_known(world):
    world.until("document.querySelector('#map-said').textContent.includes('label window reaches')", "the window")
    world.until_it_changes("#map")
    said = world.text("#map-said")
    assert re.search(r"reaches \d+ s back, by the clock; in it the robot got \d\.\d\d m away", said)
    assert float(re.search(r"known to (\d+\.\d) mm", said).group(1)) > 0
    world.until(
        "/[1-9]\\d* places where a sensor fired/.test(document.querySelector('#map').ariaLabel)", "a sensor fired"
    )


def test_curves_grow(world):
    world.until("document.querySelectorAll('#curves-table tbody tr').length > 0", "a first point")
    assert world.page.locator("#auc canvas").count() == 1
    rows = world.page.locator("#curves-table tbody tr").count()
    world.until(f"document.querySelectorAll('#curves-table tbody tr').length > {rows}", "another point")
    world.until("/0\\.\\d+ \\[/.test(document.querySelector('#curves-table').textContent)", "an AUC with its interval")
    cells = [float(cell) for cell in re.findall(r"(\d\.\d{3}) \[", world.page.inner_html("#curves-table"))]
    assert cells
    assert all(0 <= cell <= 1 for cell in cells)
    assert world.page.evaluate("document.querySelector('#curves-said').textContent").startswith("Robot minute")


def test_the_memory_is_shown(world):
    world.until("document.querySelectorAll('#thumbnails img').length >= 8", "thumbnails")
    assert world.page.eval_on_selector("#thumbnails img", "e => e.naturalWidth") >= 20
    assert re.search(r"\d+ frames: the newest \d+", world.text("#memory-said"))
    [negative, positive] = map(int, re.findall(r"\d+", world.page.get_attribute("#counts", "aria-label")))
    assert negative > positive > 0


def test_a_past_frame_is_explained(world):
    world.until(
        "parseInt(/(\\d+) % known/.exec(document.querySelector('#film li:nth-child(2) .said')?.textContent)?.[1]) > 0",
        "labels",
    )
    world.page.click("#film li:nth-child(2) button")
    world.until("document.querySelectorAll('#explain-body tbody tr').length > 0", "reasons")
    said = world.text("#explain-body > p")
    known, total = map(int, re.search(r"(\d+) of (\d+) labels are known", said).groups())
    bits = world.page.locator("#explain-body .bits b:not(.bu)").count()
    assert bits == known <= total
    cells = world.page.locator("#explain-body tbody tr").first.locator("td").all_inner_texts()
    assert re.fullmatch(r"[+−]\d+\.\d\d s", cells[3])
    assert float(cells[4].removesuffix(" mm")) <= 10.0
    assert world.page.evaluate("location.hash").startswith("#frame=")
    world.shoot("explain")
    assert world.page.locator("#stop").is_enabled()
    world.page.keyboard.press("Escape")
    world.page.wait_for_selector("#explain", state="hidden")
    assert world.page.locator("#release").is_hidden()


def test_the_learner_obeys_the_buttons(world):
    page, agents = world.page, world.agents
    page.click("#pause")
    until(lambda: agents.learner.paused, "the pause")
    page.wait_for_selector("#findings [data-cause=paused]")
    assert world.text("#why-title") == "Why is it not learning?"
    world.until("document.querySelector('#pause').textContent === 'Resume learning'", "what the page says")
    # Paused, no new version takes the place of the one that is chosen.
    newest = agents.learner.version
    page.select_option("#version", index=0)
    page.click("#roll-back")
    world.until("/^(Back|Not)/.test(document.querySelector('#command-said').textContent)", "what the page says")
    assert world.text("#command-said").startswith("Back to version")
    until(lambda: agents.learner.version > newest, "a version published anew")
    page.click("#pause")
    until(lambda: not agents.learner.paused, "learning goes on")
    page.click("#save")
    world.until("document.querySelector('#command-said').textContent.startsWith('Saved to')", "what the page says")
    saved = Path(world.text("#command-said").removeprefix("Saved to "))
    assert saved.parent == agents.folder / "saved"
    assert checkpoint.load(saved)[1]["version"] > 0


def test_stop_wins_over_the_controller_and_holds(world):
    page, agents = world.page, world.agents
    until(agents.is_driving, "it drives")
    page.click("#stop")
    world.until(
        "document.querySelector('#stop-said').textContent.includes('stand still until released')", "what the page says"
    )
    until(lambda: agents.robot.stopped, "the robot says so")
    metres, sent, lived_s = agents.robot.metres, len(agents.commands), agents.robot.robot_s
    until(lambda: agents.robot.robot_s > lived_s + 8, "seconds of standing still")
    assert agents.robot.metres < metres + 0.02  # what it still rolled
    still = agents.robot.metres
    until(lambda: agents.robot.robot_s > lived_s + 12, "more of them")
    assert agents.robot.metres == pytest.approx(still, abs=1e-6)
    assert {(0.0, 0.0)} == set(agents.commands[sent + 2 :])
    page.wait_for_selector("#findings [data-cause=stopped]")
    world.shoot("stopped")
    agents.kill("controller")
    agents.start("controller", "control", "--behaviour", "explore")
    agents.wait_present("controller")
    lived_s = agents.robot.robot_s
    until(lambda: agents.robot.robot_s > lived_s + 6, "seconds with a controller that came later")
    assert agents.robot.metres == pytest.approx(still, abs=1e-6)
    page.click("#release")
    until(agents.is_driving, "it drives again")
    page.wait_for_selector("#release", state="hidden")
    page.keyboard.press("Escape")
    page.wait_for_selector("#release")
    page.click("#release")
    until(agents.is_driving, "it drives once more")


def test_a_robot_that_is_silent_is_unmistakable(world):
    robot = world.agents.processes["robot"]
    robot.send_signal(signal.SIGSTOP)
    try:
        world.until(
            "document.querySelector('#banner').textContent.includes('robot has been silent')", "what the page says"
        )
        assert world.page.locator("#ground.old").count() == 1
        assert world.page.locator("#now.old").count() == 1
        world.page.wait_for_selector("#findings [data-cause='odometry missing']")
    finally:
        robot.send_signal(signal.SIGCONT)
    world.page.wait_for_selector("#banner", state="hidden")
    assert world.page.locator("#ground.old").count() == 0


def test_a_dashboard_that_is_stale_or_gone_is_unmistakable(world):
    dashboard = world.agents.processes["dashboard"]
    dashboard.send_signal(signal.SIGSTOP)
    world.page.wait_for_selector("[data-link=stale]")
    assert "silent for" in world.text("#banner")
    # However long it hangs, those that it looks at go on, and lose nothing by it.
    counts, sensed = world.agents.counts, [world.agents.missed[name] for name in ("odom", "range")]
    predictions, missed = counts["prediction"], [one.missed for one in sensed]
    until(lambda: counts["prediction"] > predictions + 100, "predictions while the dashboard hangs")
    assert world.agents.is_driving()
    assert [one.missed for one in sensed] == missed
    dashboard.send_signal(signal.SIGCONT)
    world.page.wait_for_selector("[data-link=live]")
    world.agents.kill("dashboard")
    world.page.wait_for_selector("[data-link=lost]")
    world.until("document.querySelector('#banner').textContent.startsWith('Not connected')", "the banner")
    assert world.page.evaluate("getComputedStyle(document.querySelector('main')).filter") != "none"
    world.page.click("#stop")
    world.until("document.querySelector('#stop-said').textContent.startsWith('STOP WAS NOT SENT')", "the warning")
    world.shoot("lost")
    world.faults.clear()
    world.start_dashboard()
    world.page.wait_for_selector("[data-link=live]")
    world.until("document.querySelector('#banner').hidden", "all is well again")
    assert world.agents.is_driving()


def test_it_fits_a_phone_with_the_stop_in_reach(world):
    page = world.open(viewport={"width": 390, "height": 780}, color_scheme="dark", device_scale_factor=2)
    try:
        page.wait_for_selector("#film li[data-key]")
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        for y in (0, 1500):
            page.evaluate(f"scrollTo(0, {y})")
            box = page.locator("#stop").bounding_box()
            assert box["y"] + box["height"] <= 780
            assert box["height"] >= 44
            assert box["width"] >= 200
        page.evaluate("scrollTo(0, 0)")
        if world.screenshots is not None:
            page.wait_for_timeout(1500)
            page.screenshot(path=str(world.screenshots / "dashboard-phone.png"))
    finally:
        page.close()


def test_keyboard_and_screen_reader(world):
    page = world.open(viewport={"width": 1400, "height": 950})
    try:
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.className") == "skip"
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.id") == "stop"
        reached = set()
        for _ in range(12):
            page.keyboard.press("Tab")
            reached.add(page.evaluate("document.activeElement.id"))
        assert {"pause", "save", "version", "roll-back", "film"} <= reached
        nameless = page.evaluate(
            "[...document.querySelectorAll('canvas, img, button, select')]"
            ".filter(e => !e.closest('[hidden], .plot, dialog') && !e.ariaHidden)"
            ".filter(e => !(e.ariaLabel || e.alt || e.textContent.trim() || e.labels?.length)"
            " && !e.closest('button')).map(e => e.outerHTML)"
        )
        assert nameless == []
        assert {"status", "alert"} <= set(page.evaluate("[...document.querySelectorAll('[role]')].map(e => e.role)"))
    finally:
        page.close()


def test_light_and_dark_differ_and_can_be_read(world):
    page = world.open(viewport={"width": 1400, "height": 950})
    try:
        for scheme in ("light", "dark"):
            page.emulate_media(color_scheme=scheme)
            for ink, back in (
                ("--ink", "--card"),
                ("--quiet", "--card"),
                ("--bad", "--bad-back"),
                ("--warn", "--warn-back"),
            ):
                colours = [
                    page.evaluate(f"getComputedStyle(document.documentElement).getPropertyValue('{name}').trim()")
                    for name in (ink, back)
                ]
                assert contrast(*colours) >= 4.5, (scheme, ink, back)
    finally:
        page.close()


def contrast(one, other):
    """Of two colours such as #a0b0c0, as WCAG 2 has it."""

    def luminance(colour):
        parts = np.array([int(colour[n : n + 2], 16) for n in (1, 3, 5)]) / 255
        linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
        return float(linear @ [0.2126, 0.7152, 0.0722])

    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def ask(world, method, path, body=None, **headers):
    connection = http.client.HTTPConnection("127.0.0.1", world.port, timeout=WAIT_S)
    try:
        connection.request(method, path, body=body, headers={name.replace("_", "-"): v for name, v in headers.items()})
        reply = connection.getresponse()
        return reply.status, reply.read(), dict(reply.getheaders())
    finally:
        connection.close()


def test_strangers_are_refused(world):
    own = f"http://127.0.0.1:{world.port}"
    stop = json.dumps({"stop": False})
    assert ask(world, "POST", "/stop", stop)[0] == 403
    assert ask(world, "POST", "/stop", stop, Origin="http://elsewhere.example")[0] == 403
    assert ask(world, "POST", "/stop", stop, Origin="http://evil.example", Host="evil.example")[0] == 403
    assert ask(world, "GET", "/", Host="evil.example")[0] == 403
    assert ask(world, "POST", "/stop", stop, Origin=own)[0] == 200
    assert ask(world, "POST", "/stop", "{}", Origin=own)[0] == 400
    assert ask(world, "POST", "/learner", json.dumps({"command": "reset"}), Origin=own)[0] == 400
    assert ask(world, "POST", "/learner", json.dumps({"command": "save", "path": "/etc/x"}), Origin=own)[0] == 400
    assert ask(world, "GET", "/past/999999/0")[0] == 404
    status, _, headers = ask(world, "GET", "/")
    assert status == 200
    assert "script-src 'self'" in headers["content-security-policy"]
    assert "unsafe" not in headers["content-security-policy"]


def test_only_its_own_page_may_listen_and_one_that_asks_for_nothing_gets_nothing(world):
    client = pytest.importorskip("websockets.sync.client")
    from websockets.exceptions import InvalidStatus

    address = f"ws://127.0.0.1:{world.port}/live"
    for origin in (None, "http://elsewhere.example"):
        with pytest.raises(InvalidStatus):
            client.connect(address, origin=origin)
    with client.connect(address, origin=f"http://127.0.0.1:{world.port}", compression=None) as slow:
        assert json.loads(slow.recv(timeout=WAIT_S))["robot"] == "thymio"
        slow.send("more")
        assert isinstance(slow.recv(timeout=WAIT_S), bytes)
        with pytest.raises(TimeoutError):
            slow.recv(timeout=1.0)
        frames = world.page.evaluate("dashboard.link.frames")
        world.until(f"dashboard.link.frames > {frames} + 10", "the other browser is told on")
        slow.send("more")
        late = slow.recv(timeout=WAIT_S)
        told = json.loads(late[4 : 4 + int.from_bytes(late[:4], "little")])
        assert len(told["path"]) <= 4000


def test_the_pages_of_the_docs(world):
    """Last: by now there is most to see."""
    if world.screenshots is None:
        pytest.skip("to take the pictures of the docs: --screenshots docs/pictures")
    world.page.close()
    world.page = world.open(viewport={"width": 1400, "height": 950})
    minutes = 6 * 60
    until(lambda: world.agents.learner.robot_s > minutes, "six robot minutes", timeout_s=300)
    time.sleep(20)
    world.shoot("light", full_page=True)


def test_loading_the_command_line_loads_no_web_server():
    script = "import agents.cli, agents.commands.dashboard, sys; print({'starlette', 'uvicorn'} & {*sys.modules})"
    said = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, cwd=ROOT)
    assert said.stdout.strip() == "set()"
