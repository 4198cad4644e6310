"""The whole story in a minute: `llrp demo` from its first word to its report; interrupted; killed."""

import json
import re
import signal
import subprocess
import sys
import time

import psutil
import pytest

from agents.commands.demo import has_dashboard
from llrp_online import checkpoint
from replay.recording import read
from tests.agents.processes import ROOT, patience_s, quick_configuration, until

pytestmark = [pytest.mark.live, pytest.mark.slow, pytest.mark.timeout(600)]
AGENTS = {"recorder", "perceiver", "learner", "controller", "robot"}


def demo(folder, *words):
    config = quick_configuration(folder)
    return subprocess.Popen(
        [sys.executable, "-m", "agents.cli", "demo", "--config", str(config), "--output", str(folder / "run"), *words],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=ROOT,
    )


def children(process):
    """The agents: whoever else there is compiles for one of them, and ends with it."""
    found = psutil.Process(process.pid).children(recursive=True)
    return [child for child in found if "replay.compiling" not in child.cmdline()]


def recorded_bytes(folder):
    """How far the run has come, by its recording."""
    recording = folder / "run" / "run.mcap"
    return recording.stat().st_size if recording.exists() else 0


def test_a_minute_ends_with_a_report(tmp_path):
    words = ("--minutes", "1", "--drive-minutes", "0.3", "--held-out-minutes", "1", "--speed", "6", "--json")
    process = demo(tmp_path, *words)
    if has_dashboard():  # nobody minds if it ends
        until(lambda: any("dashboard" in child.cmdline() for child in children(process)), "the dashboard")
        next(child for child in children(process) if "dashboard" in child.cmdline()).kill()
    out, err = process.communicate(timeout=500)
    assert process.returncode == 0, err
    assert ("watch it in a browser: http://127.0.0.1:" in err) is has_dashboard()
    assert "Traceback" not in err
    said, run = json.loads(out), tmp_path / "run"
    assert said["report"] == str(run / "report.html")
    [point] = said["learning_curve"]
    assert point["minute"] == 1
    assert 0 <= point["mean_auc_0_15_cm"] <= 1
    assert point["cells_0_15_cm"] > 0

    page = (run / "report.html").read_text()
    assert "tiles, seed 0" in page
    assert page.count("data:image/") >= 4
    assert not re.search(r"""(?:src|href)=["']?https?://""", page)  # whole without a network
    report = json.loads((run / "report.json").read_text())
    assert report["config"]["robot"]["name"] == "thymio"
    assert report["seed"] == 0
    assert {"torch", "llrp-online"} <= set(report["versions"])
    [score] = report["scores"].values()
    assert set(score) == {"targets", "sensors", "auc", "low", "high", "n_pos", "n_neg", "pooled_auc"}
    assert (len(score["auc"]), len(score["auc"][0])) == (31, 5)

    tensors, manifest = checkpoint.load(run / "checkpoint")
    assert manifest["training"]["steps"] > 50
    assert set(checkpoint.load(run / "minutes" / "001")[0]["weights"]) == set(tensors["weights"])
    reader = read(run / "run.mcap")
    topics = {message.topic for message in reader}
    assert reader.report.finished
    said_by_all = ("odom", "range", "camera/image/compressed", "cmd_vel", "prediction", "labels", "learner/status")
    assert {f"/thymio/{topic}" for topic in said_by_all} <= topics
    for name in AGENTS:
        assert "Traceback" not in (run / "logs" / f"{name}.log").read_text()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_it_ends_soon_and_keeps_what_was_learned(tmp_path, number):
    process = demo(tmp_path, "--minutes", "10")
    until(lambda: process.poll() is not None or recorded_bytes(tmp_path) > 200_000, "a recording that grows")
    agents = children(process)
    assert len(agents) == len(AGENTS) + has_dashboard()
    began_s = time.monotonic()
    process.send_signal(number)
    out, err = process.communicate(timeout=60)
    assert time.monotonic() - began_s < patience_s()
    assert process.returncode == 130
    assert out == ""
    assert f"stopped; what was learned until then is in {tmp_path / 'run' / 'checkpoint'}" in err
    assert "Traceback" not in err
    assert not any(agent.is_running() for agent in agents)
    checkpoint.load(tmp_path / "run" / "checkpoint")
    assert read(tmp_path / "run" / "run.mcap").report.finished
    for log in (tmp_path / "run" / "logs").glob("*.log"):
        assert "Traceback" not in log.read_text()


def test_killed_it_leaves_no_agent_behind(tmp_path):
    process = demo(tmp_path, "--minutes", "10")
    until(lambda: process.poll() is not None or recorded_bytes(tmp_path) > 100_000, "a recording that grows")
    agents = children(process)
    assert len(agents) == len(AGENTS) + has_dashboard()
    process.kill()
    process.communicate()
    _, alive = psutil.wait_procs(agents, timeout=patience_s() + 1.0)
    assert alive == []
    checkpoint.load(tmp_path / "run" / "checkpoint")


def test_an_agent_that_dies_ends_it_with_the_reason(tmp_path):
    process = demo(tmp_path, "--minutes", "10")
    until(lambda: process.poll() is not None or recorded_bytes(tmp_path) > 100_000, "a recording that grows")
    [perceiver] = [child for child in children(process) if "perceive" in child.cmdline()]
    perceiver.kill()
    _, err = process.communicate(timeout=60)
    assert process.returncode == 1
    assert "llrp demo: perceiver ended with exit code -9" in err
    assert "Traceback" not in err
