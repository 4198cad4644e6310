import dataclasses
import io

import numpy as np
import pytest
from rich.console import Console

from agents.status import PerceiverStatus
from agents.terminal import STALE_S, Glance, LearnerView, Rate, Terminal
from llrp_online.prequential import Band
from llrp_online.status import LearnerStatus
from replay.targets import Targets

TARGETS = Targets.line(0.0, 0.30, 0.01).poses
STATUS = LearnerStatus(
    robot_s=372.4,
    frames=12_195,
    waiting=300,
    labelled=9_000,
    known=[1000] * 8 + [500] * 8 + [10] * 8 + [0] * 7,
    positives=[100] * 8 + [200] * 8 + [0] * 8 + [0] * 7,
    remembered=4_000,
    steps=1_830,
    let_go=7.0,
    loss=0.2345,
    version=37,
    version_age_s=4.2,
    rejected=3,
    bands=[
        Band(0.0, 0.07, 0.771, 1243, 15_289, 0.37),
        Band(0.08, 0.15, 0.812, 500, 4_000, 0.3),
        Band(0.16, 0.23, None, 0, 300, 0.3),
        Band(0.24, 0.30, None, 0, 0, None),
    ],
    drift_events=2,
    drops={"reading: its time was there already [x]": 16, "odometry: not a number": 0},
    paused=False,
)
GLANCE = Glance(
    STATUS,
    age_s=0.4,
    steps_per_s=5.13,
    perception=PerceiverStatus(frames=512, frames_per_s=20.1, p50_ms=2.34, p99_ms=7.89, p999_ms=12.3, version=36),
    agents={"robot": True, "learner": True, "controller": False},
)
VIEW = LearnerView("thymio", TARGETS)


def shown(glance, width=80):
    console = Console(width=width, file=io.StringIO(), force_terminal=False)
    console.print(VIEW.render(glance))
    return console.file.getvalue()


def row_of(text, start):
    (row,) = (line for line in text.splitlines() if start in line)
    return row


def test_all_figures_are_there_at_80_columns():
    text = shown(GLANCE)
    assert {len(line) for line in text.splitlines()} == {80}
    for figure in (
        "6.2 robot minutes",
        "12,195 seen, 300 waiting, 9,000 labelled",
        "step 1,830, 5.1 steps/s, 7 let go, loss 0.2345",
        "version 37, 4 s old, 3 rejected",
        "20.1 frames/s, p50 2.3 ms, p99 7.9 ms, version 36",
        "2 events",
        "16 reading: its time was there already [x]",
        "robot up",
        "controller GONE",
    ):
        assert figure in text
    assert "not a number" not in text
    assert "STALE" not in text
    assert "PAUSED" not in text
    assert "…" not in text


def test_bands_show_known_labels_and_the_prequential_score():
    text = shown(GLANCE)
    near, middle, far, farthest = (row_of(text, start) for start in ("0.00 to", "0.08 to", "0.16 to", "0.24 to"))
    assert near.split()[-6:-1] == ["8,000", "10.0", "0.771", "1,243", "15,289"]
    assert middle.split()[-6:-1] == ["4,000", "40.0", "0.812", "500", "4,000"]
    assert far.split()[-5:-1] == ["80", "0.0", "0", "300"]
    assert (near.count("█"), near.count("░")) == (2, 16)
    assert (middle.count("█"), middle.count("░")) == (4, 5)
    assert (far.count("█"), far.count("░")) == (0, 1)
    assert (farthest.count("█"), farthest.count("░")) == (0, 0)


@pytest.mark.parametrize("age_s", [STALE_S + 0.1, 125.0, None])
def test_a_stale_status_is_unmistakable(age_s):
    stale = dataclasses.replace(GLANCE, age_s=age_s)
    heard = "never heard" if age_s is None else f"last heard {age_s:.0f} s ago"
    text = shown(stale)
    assert "thymio: STALE" in text.splitlines()[0]
    assert f"STALE: {heard}" in text
    assert VIEW.line(stale).startswith(f"thymio: STALE, {heard}; ")
    assert "STALE" not in VIEW.line(GLANCE)


def test_what_is_unknown_is_a_dash():
    young = dataclasses.replace(STATUS, loss=None, version=None, version_age_s=None, bands=[], drops={})
    text = shown(Glance(young, age_s=0.0))
    assert "- steps/s" in text
    assert "loss -" in text
    assert "version -, - s old" in text
    assert "none seen" in text
    assert "loss -" in VIEW.line(Glance(young, age_s=0.0))
    assert "None" not in text + VIEW.line(Glance(young, age_s=0.0))


def test_before_the_first_status_it_says_so():
    waiting = Glance(None, agents={"learner": False})
    assert "no status from the learner yet" in shown(waiting)
    assert "learner GONE" in shown(waiting)
    assert not waiting.stale


def test_a_pause_is_said():
    paused = dataclasses.replace(GLANCE, status=dataclasses.replace(STATUS, paused=True))
    assert "PAUSED" in shown(paused)
    assert "paused" in VIEW.line(paused)


def test_the_line_is_one_plain_line_with_the_figures():
    line = VIEW.line(GLANCE)
    assert "\n" not in line
    assert line.isascii()
    for figure in ("6.2 min", "step 1830 (5.1/s)", "0.77 (n+ 1243, n- 15289)", "version 37", "p99 7.9 ms", "drops 16"):
        assert figure in line
    assert line.endswith("gone: controller")


def test_rate_looks_back_ten_seconds_and_begins_anew_after_a_reset():
    rate = Rate()
    assert rate.update(0, 0.0) is None
    for second in range(1, 20):
        found = rate.update(5 * second, float(second))
        assert found == pytest.approx(5.0)
    for second in range(20, 40):
        found = rate.update(95, float(second))
    assert found == 0.0
    assert rate.update(3, 40.0) is None
    assert rate.update(5, 41.0) == pytest.approx(2.0)


def test_without_a_terminal_it_prints_a_line_every_so_often():
    now_s = iter([0.0, 4.0, 9.9, 10.1, 12.0])
    console = Console(file=io.StringIO(), force_terminal=False, width=40)
    with Terminal(VIEW, console, every_s=10.0, clock=lambda: next(now_s)) as terminal:
        for _ in range(5):
            terminal.show(GLANCE)
    assert console.file.getvalue() == f"{VIEW.line(GLANCE)}\n" * 2


def test_on_a_terminal_it_draws_in_place_and_gives_it_back():
    console = Console(file=io.StringIO(), force_terminal=True, width=80, height=40, legacy_windows=False)
    with Terminal(VIEW, console) as terminal:
        terminal.show(GLANCE)
        terminal.show(dataclasses.replace(GLANCE, age_s=12.0))
    text = console.file.getvalue()
    assert "6.2 robot minutes" in text
    assert "last heard 12 s ago" in text
    assert text.rindex("\x1b[?25h") > text.index("\x1b[?25l")  # the cursor is shown again


def test_many_targets_on_a_grid_fit_too():
    poses = Targets.grid([-3.0, 5.0, 0.5], [-4.0, 4.0, 0.5]).poses
    far_m = float(np.hypot(poses[:, 0], poses[:, 1]).max())
    band = Band(0.0, round(far_m, 6), 0.9, 10, 20, 0.1)
    status = dataclasses.replace(STATUS, known=[2] * 289, positives=[1] * 289, bands=[band])
    console = Console(width=80, file=io.StringIO())
    console.print(LearnerView("pioneer", poses).render(Glance(status, 0.0)))
    assert "578" in row_of(console.file.getvalue(), "0.00 to 6.40")
