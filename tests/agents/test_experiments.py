"""The machinery of studies: trials kept and gone on from, lost processes, shared drives, pages."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from agents import cli
from agents.experiments import results
from agents.experiments.cluster import Cluster
from agents.experiments.drives import Drive
from agents.experiments.findings import Claim, Findings, Plot, section, write
from agents.experiments.learning import Start
from agents.experiments.local import Local, TrialError
from agents.experiments.settings import changed, configuration_of, plain, scenario, scenarios
from agents.experiments.shared import made_once
from agents.experiments.statistics import median
from agents.experiments.trial import Done, Shelf, Trial
from llrp_online.figures.style import new_figure

SQUARE = "tests.agents.work:square"


def test_trials_run_in_processes_and_give_what_they_give_here(tmp_path: Path) -> None:
    trials = [Trial(SQUARE, {"x": x}) for x in (1, 2, 3)]
    with Local(2, tmp_path) as local:
        found = {trial.name: done.result for trial, done in local.run(trials)}
    assert found == {trial.name: trial.run(tmp_path) for trial in trials}
    assert [found[trial.name]["square"] for trial in trials] == [1, 4, 9]


def test_a_trial_that_fails_names_itself_and_says_why(tmp_path: Path) -> None:
    trial = Trial("tests.agents.work:fail", {"why": "no floor"})
    with Local(1, tmp_path) as local, pytest.raises(TrialError, match=rf"(?s){trial.name}.*no floor"):
        list(local.run([trial]))


def test_a_killed_process_costs_its_trial_only(tmp_path: Path) -> None:
    trial = Trial("tests.agents.work:die_once", {"mark": str(tmp_path / "died")})
    with Local(1, tmp_path) as local:
        ((_, done),) = local.run([trial])
    assert done.result == {"lived": True}
    assert (tmp_path / "died").exists()


def test_a_process_killed_each_time_is_an_error(tmp_path: Path) -> None:
    with Local(1, tmp_path) as local, pytest.raises(TrialError, match="failed"):
        list(local.run([Trial("tests.agents.work:die", {})]))


def test_ending_early_leaves_no_process(tmp_path: Path) -> None:
    slow = [Trial("tests.agents.work:wait", {"mark": str(tmp_path / f"{i}.pid")}) for i in range(3)]
    with Local(2, tmp_path) as local:
        threading.Thread(target=lambda: list(_until_stopped(local, slow)), daemon=True).start()
        while len(marks := list(tmp_path.glob("*.pid"))) < 2:
            time.sleep(0.02)
    for mark in marks:
        _gone(int(mark.read_text()))


def _until_stopped(local: Local, trials: list[Trial]) -> Iterator[None]:
    with suppress(TrialError):
        yield from (None for _ in local.run(trials))


def test_a_worker_ends_when_whoever_asked_dies(tmp_path: Path) -> None:
    program = (
        "from pathlib import Path; from agents.experiments.local import Local; "
        "from agents.experiments.trial import Trial\n"
        f"with Local(1, Path('{tmp_path}')) as local:\n"
        f"    list(local.run([Trial('tests.agents.work:wait', {{'mark': '{tmp_path}/asked.pid'}})]))"
    )
    asking = subprocess.Popen([sys.executable, "-c", program])
    while not (mark := tmp_path / "asked.pid").exists():
        time.sleep(0.02)
    asking.kill()
    asking.wait()
    _gone(int(mark.read_text()))


def _gone(pid: int) -> None:
    for _ in range(500):
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return
        if Path(f"/proc/{pid}/stat").read_text().split()[2] == "Z":
            return
        time.sleep(0.02)
    pytest.fail(f"process {pid} lives on")


def test_a_shelf_gives_back_what_was_put_and_nothing_else(tmp_path: Path) -> None:
    shelf, trial = Shelf(tmp_path), Trial(SQUARE, {"x": 3})
    assert shelf.get(trial) is None
    shelf.put(trial, Done({"square": 9}, 0.5))
    assert shelf.get(trial) == {"square": 9}
    assert shelf.computing_s([trial, trial]) == 1.0
    assert shelf.get(Trial(SQUARE, {"x": 4})) is None
    (tmp_path / f"{trial.name}.json").write_text('{"parameters": {"x": 3}, "res')
    assert shelf.get(trial) is None


def test_a_shelf_tells_what_other_code_left_on_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shelf, trials = Shelf(tmp_path), [Trial(SQUARE, {"x": x}) for x in (1, 2)]
    shelf.put(trials[0], Done({"square": 1}, 0.5))
    monkeypatch.setattr("agents.experiments.trial.code", lambda: "changed")
    shelf.put(trials[1], Done({"square": 4}, 0.5))
    assert [shelf.of_other_code([trial]) for trial in trials] == [1, 0]
    assert shelf.get(trials[0]) == {"square": 1}


def test_a_drive_is_recorded_once(tmp_path: Path) -> None:
    drive = Drive(configuration_of("thymio").model_dump(mode="json"), scenario("tiles"), seed=1, minutes=0.02)
    first = drive.recorded(tmp_path)
    stamp, content = first.stat().st_mtime_ns, first.read_bytes()
    assert drive.recorded(tmp_path) == first
    assert first.stat().st_mtime_ns == stamp
    assert Drive.of(drive.as_json()).recorded(tmp_path / "elsewhere").read_bytes() == content


def test_what_a_learner_begins_with_is_lived_once(tmp_path: Path) -> None:
    told = configuration_of("thymio").model_dump(mode="json")
    start = Start(told, [Drive(told, scenario("tiles"), seed=1, minutes=0.05)])
    first = start.checkpoint(tmp_path)
    stamp = (first / "manifest.json").stat().st_mtime_ns
    assert Start.of(asdict(start)).checkpoint(tmp_path) == first
    assert (first / "manifest.json").stat().st_mtime_ns == stamp


def test_what_was_left_half_made_is_thrown_away(tmp_path: Path) -> None:
    (tmp_path / "it.part").mkdir()
    (tmp_path / "it.part" / "rest").touch()
    path = made_once(tmp_path / "it", lambda part: part.write_text("whole"))
    assert path.read_text() == "whole"


def test_a_changed_key_is_checked() -> None:
    usual = configuration_of("thymio")
    assert changed(usual, {"memory.policy": "fifo"}).memory.policy == "fifo"
    with pytest.raises(ValueError, match=r"memory\.polcy: no such key"):
        changed(usual, {"memory.polcy": "fifo"})
    with pytest.raises(ValueError, match="policy"):
        changed(usual, {"memory.policy": "best"})


def test_all_ten_scenarios_are_found() -> None:
    assert len(scenarios()) == 10


@pytest.mark.parametrize(
    ("value", "bar", "at_most", "holds"),
    [(0.9, 0.8, False, True), (0.7, 0.8, False, False), (0.1, 0.2, True, True), (0.3, None, False, None)],
)
def test_a_claim_holds_or_does_not(value: float, bar: float | None, at_most: bool, holds: bool | None) -> None:
    assert Claim("it", value, bar, None, "3 runs", at_most).holds is holds


def test_an_undefined_claim_is_blank_and_never_holds() -> None:
    assert Claim("it", None, 0.8, None, "none").holds is None


def test_the_median_of_one_run_has_no_width() -> None:
    assert median([0.7]) == (0.7, (0.7, 0.7))
    with pytest.raises(ValueError, match="got none"):
        median([])


def _findings(value: float) -> Findings:
    return Findings("a <title>", "What was done.", [Claim("a|b", value, 0.8, (0.7, 0.9), "3 runs")], {"x": value})


def test_a_page_of_results_holds_each_study_once(tmp_path: Path) -> None:
    page = tmp_path / "RESULTS.md"
    results.put(page, "scratch", _findings(0.81), "1 trial")
    results.put(page, "window", _findings(0.82), "2 trials")
    results.put(page, "scratch", _findings(0.79), "3 trials")
    text = page.read_text()
    assert text.count("llrp experiment scratch --results") == 1
    assert "0.810" not in text
    assert "| a/b | 0.790 | 0.700 to 0.900 | at least 0.8 | short of it | 3 runs |" in text
    assert "0.820" in text
    assert section(_findings(0.79), "llrp experiment scratch --results docs/RESULTS.md", "3 trials") in text
    assert "1 trial." not in text


def test_a_page_of_results_shows_the_figures_that_a_study_has_now(tmp_path: Path) -> None:
    page, first, then = tmp_path / "RESULTS.md", new_figure(2.0, 2.0), new_figure(2.0, 2.0)
    results.put(page, "window", replace(_findings(0.8), plots=[Plot("old", first, "another's")]), "1 trial")
    results.put(page, "scratch", replace(_findings(0.8), plots=[Plot("old", first, "an old one")]), "1 trial")
    results.put(page, "scratch", replace(_findings(0.8), plots=[Plot("new", then, "a curve", "It rises.")]), "1 trial")
    text = page.read_text()
    assert "![a curve](pictures/results/scratch-new.png)\n\n*It rises.*\n" in text
    assert "an old one" not in text
    shown = sorted(path.name for path in (tmp_path / "pictures" / "results").iterdir())
    assert shown == ["scratch-new.png", "window-old.png"]


def test_findings_are_written_as_json_and_page(tmp_path: Path) -> None:
    page = write(_findings(0.81), tmp_path, [0, 1]).read_text()
    assert "a &lt;title&gt;" in page
    told = json.loads((tmp_path / "report.json").read_text())
    assert told["seeds"] == [0, 1]
    assert told["claims"][0]["holds"] is True


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study in its small form, run through in local processes."""
    folder = tmp_path_factory.mktemp("whole") / "scratch"
    assert cli.main(["experiment", "scratch", "--quick", "--output", str(folder)]) == 0
    return folder


def _begun(output: Path, *words: str) -> "subprocess.Popen[bytes]":
    """The same study in a process of its own, one trial of which is done."""
    all_words = ["experiment", "scratch", "--quick", "--output", str(output), *words]
    process = subprocess.Popen([sys.executable, "-m", "agents.cli", *all_words])
    while not list((output / "trials").glob("*.json")):
        assert process.poll() is None
        time.sleep(0.1)
    return process


@pytest.mark.slow
def test_a_study_killed_half_way_goes_on_and_gives_the_same_json(whole: Path, tmp_path: Path) -> None:
    halted = tmp_path / "scratch"
    process = _begun(halted)
    process.send_signal(signal.SIGKILL)
    process.wait()
    kept = {path: path.stat().st_mtime_ns for path in (halted / "trials").glob("*.json")}
    assert cli.main(["experiment", "scratch", "--quick", "--output", str(halted)]) == 0
    assert all(path.stat().st_mtime_ns == stamp for path, stamp in kept.items())
    assert (halted / "report.json").read_bytes() == (whole / "report.json").read_bytes()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::FutureWarning", "ignore::ResourceWarning")  # Ray's own
def test_a_cluster_gives_the_same_and_a_lost_worker_changes_nothing(tmp_path: Path) -> None:
    pytest.importorskip("ray", reason="the extra `cluster` is not installed")
    from ray.cluster_utils import Cluster as Machines

    trials = [Trial(SQUARE, {"x": x}) for x in range(4)]
    trials.append(Trial("tests.agents.work:die_once", {"mark": str(tmp_path / "died")}))
    machines = Machines(initialize_head=True, head_node_args={"num_cpus": 2, "include_dashboard": False})
    try:
        with Cluster(str(machines.address), tmp_path) as cluster:
            found = {trial.name: done.result for trial, done in cluster.run(trials)}
    finally:
        machines.shutdown()
    assert found == {trial.name: trial.run(tmp_path) for trial in trials}


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::FutureWarning", "ignore::ResourceWarning")  # Ray's own
def test_a_study_on_two_workers_one_of_which_is_killed_gives_the_same_json(whole: Path, tmp_path: Path) -> None:
    pytest.importorskip("ray", reason="the extra `cluster` is not installed")
    from ray.cluster_utils import Cluster as Machines

    machines = Machines(initialize_head=True, head_node_args={"num_cpus": 0, "include_dashboard": False})
    try:
        workers = [machines.add_node(num_cpus=1) for _ in range(2)]
        process = _begun(tmp_path / "scratch", "--ray", str(machines.address))
        machines.remove_node(workers[0], allow_graceful=False)
        assert process.wait() == 0
    finally:
        machines.shutdown()
    assert (tmp_path / "scratch" / "report.json").read_bytes() == (whole / "report.json").read_bytes()


def test_what_came_later_is_told_only_where_it_is_not_as_by_default() -> None:
    usual = configuration_of("thymio")
    assert "calibration" not in plain(usual)
    assert "colour" not in plain(usual)["augmentation"]
    other = changed(usual, {"augmentation.colour": 0.5, "calibration.every_s": 5.0})
    assert plain(other)["augmentation"]["colour"] == 0.5
    assert plain(other)["calibration"]["every_s"] == 5.0
