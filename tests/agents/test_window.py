"""`llrp window`, and the study of the same name."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from agents import messages
from agents.cli import main
from agents.drive_arrays import drive_of
from agents.experiments import window
from agents.experiments.labelling import BLIND_DRIFT, label
from agents.experiments.settings import changed, configuration_of, scenario
from agents.offline import labels_of
from agents.robots.simulated import Scenario
from agents.simulated_drive import record_drive
from agents.window_answer import Answer, Row, learner_of
from llrp_online.configuration import load
from llrp_online.events import OdometrySample
from llrp_online.windows import DRIFT, UNLIMITED
from replay.recording import Message, Writer, read
from replay.resolution import resolve

THYMIO = "configs/thymio.toml"
DRONE = Path(__file__).parents[3] / "shared" / "data" / "drone"
needs_data = pytest.mark.skipif(not DRONE.exists(), reason=f"the real recordings are not at {DRONE}")
ROW = {"window", "window_s", "known", "positive", "agreeing", "felt_twice", "worth", "prequential_auc"}


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """Half a robot minute that comes back to places."""
    path = tmp_path_factory.mktemp("window") / "drive.mcap"
    record_drive(configuration_of("thymio"), Scenario.model_validate(scenario("tiles")), 3, 0.5, path)
    return path


def llrp(capsys, *words):
    capsys.readouterr()
    code = main([str(word) for word in words])
    out, err = capsys.readouterr()
    return code, out, err


def test_the_command_compares_the_windows_of_a_simulated_recording(capsys, recording, tmp_path):
    page = tmp_path / "new" / "window.html"
    code, out, err = llrp(capsys, "window", recording, "--config", THYMIO, "--output", page, "--json")
    assert code == 0, err
    told = json.loads(out)
    rows = {row["window"]: row for row in told["windows"]}
    assert list(rows) == ["1 s", "2 s", "5 s", "10 s", "20 s", UNLIMITED, DRIFT]
    assert all(set(row) == ROW for row in rows.values())
    assert told["frames"] == 300
    known = [row["known"] for row in told["windows"][:-1]]
    assert known == sorted(known)
    assert known[-1] > known[0] > 1
    assert rows[DRIFT]["known"] <= rows[UNLIMITED]["known"]
    assert rows[UNLIMITED]["felt_twice"] > 100
    assert 0.9 < rows[UNLIMITED]["agreeing"] <= 1.0
    assert all(row["worth"] <= row["known"] for row in rows.values())
    assert told["recommended"] in list(rows)[:-1]
    assert told["sentence"] in page.read_text().replace("&amp;", "&")
    assert 'src="data:image/png;base64,' in page.read_text()


def test_people_are_given_a_table_and_one_sentence(capsys, recording, tmp_path):
    code, out, _ = llrp(capsys, "window", recording, "--config", THYMIO, "--output", tmp_path / "w.html")
    assert code == 0
    lines = out.splitlines()
    assert len(lines) == 1 + 7 + 2
    assert lines[-2].startswith("Take ")
    assert "`drift` knows" in lines[-2]


def test_its_labels_are_those_of_llrp_label(recording):
    form = configuration_of("thymio")
    found = resolve(
        drive_of(form, recording),
        form.targets.build(),
        list(form.streams.values()),
        form.labels.rule(),
        form.odometry.limits(),
    )
    parts = [part.labels[part.posed] for part in labels_of(form, recording)]
    np.testing.assert_array_equal(found.labels[found.posed], np.concatenate(parts))


@needs_data
def test_a_learner_of_each_window_is_scored_on_a_real_flight(capsys, tmp_path):
    small = tmp_path / "drone.toml"
    text = (
        Path("configs/drone.toml").read_text().replace("width = 80", "width = 20").replace("height = 64", "height = 16")
    )
    small.write_text(text + "\n[training]\nbatch = 8\nwarmup_frames = 8\n[publishing]\nevery_s = 1.0\n")
    words = ["window", DRONE / "O23.mcap", DRONE / "A9.mcap", "--config", small, "--learn", "--json"]
    code, out, err = llrp(capsys, *words, "--output", tmp_path / "w.html")
    assert code == 0, err
    rows = json.loads(out)["windows"]
    assert all(0 <= row["prequential_auc"] <= 1 for row in rows)
    assert "prequential AUC" in (tmp_path / "w.html").read_text()


def test_what_cannot_be_compared_is_an_error_that_says_why(capsys, recording, tmp_path):
    words = "--config", THYMIO, "--output", tmp_path / "w.html"
    code, _, err = llrp(capsys, "window", tmp_path / "none.mcap", *words)
    assert (code, "none.mcap: cannot be read" in err) == (1, True)
    for topic in ("odom", "range", "camera/image/compressed"):
        cut = tmp_path / f"without_{topic[:4]}.mcap"
        with Writer(cut, messages.definition) as writer:
            for message in read(recording):
                if not message.topic.endswith(topic):
                    writer.write(message)
        code, _, err = llrp(capsys, "window", cut, *words)
        assert (code, f"{cut}: no message on: {topic}" in err) == (1, True), err
    far = tmp_path / "far.toml"
    far.write_text(
        Path(THYMIO).read_text().replace("start_m = 0.0", "start_m = 9.0").replace("stop_m = 0.30", "stop_m = 9.1")
    )
    code, _, err = llrp(capsys, "window", recording, "--config", far, "--output", tmp_path / "w.html")
    assert (code, "no label became known under any window" in err) == (1, True), err
    code, _, err = llrp(capsys, "window", recording, "--config", THYMIO, "--output", tmp_path)
    assert (code, "it is a folder" in err) == (1, True)


def test_odometry_that_is_no_number_is_an_error(capsys, recording, tmp_path):
    lost = tmp_path / "lost.mcap"
    with Writer(lost, messages.definition) as writer:
        for message in read(recording):
            if message.topic.endswith("odom"):
                sample = OdometrySample(message.log_ns, np.array([np.nan, 0.0, 0.0]))
                message = Message(
                    message.topic, message.type, message.log_ns, messages.encode(messages.odometry(sample))
                )
            writer.write(message)
    code, _, err = llrp(capsys, "window", lost, "--config", THYMIO, "--output", tmp_path / "w.html")
    assert (code, "lost.mcap: not one usable odometry" in err) == (1, True), err


def answer(recommended, worth=5.0, agreeing=0.97):
    one = Row("1 s", 1.0, 8.0, 1.0, agreeing, 50, worth)
    rows = [one, replace(one, window=UNLIMITED, window_s=None, known=10.0), replace(one, window=DRIFT, window_s=None)]
    return Answer(100, rows, recommended)


def test_the_sentence_says_what_to_set_or_why_nothing_can_be_said():
    assert answer("1 s").sentence() == (
        "Take labels.window_s = 1: it knows 8.0 labels a frame, and 97.0 % of what it felt twice agrees; `drift` knows "
        "8.0 labels a frame, and 97.0 % agrees, and is worth 100 % of that."
    )
    assert "without a limit" in answer(UNLIMITED).sentence()
    assert "too few places" in answer(None, worth=None).sentence()
    assert "hardly agrees beyond chance" in answer(None, worth=0.1).sentence()


def test_a_learner_of_a_window_is_told_nothing_else():
    usual = configuration_of("thymio")
    drift = learner_of(usual, DRIFT)
    assert (drift.labels.window, learner_of(usual, "5 s").labels.window_s) == ("drift", 5.0)
    assert drift.model_copy(update={"labels": usual.labels}) == usual


def test_covariance_that_is_not_trusted_is_as_good_as_none(recording, tmp_path):
    bare = tmp_path / "bare.mcap"
    with Writer(bare, messages.definition) as writer:
        for message in read(recording):
            if message.topic.endswith("odom"):
                sample = messages.odometry_sample(messages.decode(message.type, message.data))
                told = messages.odometry(replace(sample, covariance=None))
                message = Message(message.topic, message.type, message.log_ns, messages.encode(told))
            writer.write(message)
    trusting = changed(load(THYMIO), {"labels.window": "drift"})
    doubting = changed(trusting, {"odometry.trust_covariance": False})
    told = [
        np.concatenate([part.weight for part in labels_of(form, path)])
        for form, path in ((trusting, recording), (doubting, recording), (trusting, bare), (doubting, bare))
    ]
    np.testing.assert_array_equal(told[1], told[3])
    np.testing.assert_array_equal(told[1], told[2])
    assert (told[0] != told[1]).any()
    assert drive_of(doubting, recording).covariances is None


@pytest.fixture(scope="module")
def small():
    return replace(window.QUICK, minutes=0.2, scenarios=("tiles", "wood"), learned=("2 s", UNLIMITED, DRIFT))


def results_of(size, auc):
    """Labels as they are, learners as told: window -> AUC of each run."""
    taken = {cell: {name: iter(auc[name]) for name in size.learned} for cell in size.cells}
    return [
        trial.run(Path()) if name is None else {"marks": [{"new": {"far": next(taken[cell][name])}}]}
        for cell, name, trial in window._named(size)
    ]


def test_drift_is_held_against_the_best_fixed_window_pair_by_pair(small):
    found = window.findings(small, results_of(small, {"2 s": [0.8, 0.9], UNLIMITED: [0.7, 0.7], DRIFT: [0.82, 0.9]}))
    gains = [claim for claim in found.claims if "AUC with drift less that with 2 s" in claim.what]
    assert len(gains) == len(small.cells) == 2
    for claim in gains:
        assert "drift less that with 2 s" in claim.what
        assert claim.value == pytest.approx(0.01)
        assert claim.interval == pytest.approx((0.0, 0.02))
        assert (claim.bar, claim.holds) == (0.0, True)
    assert json.loads(json.dumps(found.numbers, allow_nan=False)) == found.numbers
    assert {plot.name for plot in found.plots} == {"yield_and_contradiction", "auc_by_window"}


def test_without_hindsight_a_run_is_held_against_what_the_others_choose(small):
    auc = {"2 s": [0.9, 0.5], UNLIMITED: [0.6, 0.7], DRIFT: [0.7, 0.7]}
    found = window.findings(small, results_of(small, auc))
    [best, others] = [claim for claim in found.claims if claim.what.startswith("all together: AUC with drift less")]
    assert best.value == pytest.approx((0.7 - 0.9 + 0.7 - 0.5) / 2)  # 2 s is the best of both runs
    assert others.value == pytest.approx((0.7 - 0.6 + 0.7 - 0.5) / 2)  # the second run has it the other way round
    assert (best.n[:6], best.holds) == ("4 runs", None)


def test_a_score_that_is_undefined_is_left_out_and_none_at_all_is_no_claim(small):
    found = window.findings(small, results_of(small, {"2 s": [0.8, None], UNLIMITED: [None] * 2, DRIFT: [0.7, 0.9]}))
    [claim, _] = [claim for claim in found.claims if "AUC with drift less that with 2 s" in claim.what]
    assert (claim.value, claim.holds) == (pytest.approx(-0.1), False)
    assert claim.n.startswith("1 run")
    found = window.findings(small, results_of(small, {name: [None] * 2 for name in small.learned}))
    assert not any("AUC" in claim.what for claim in found.claims)


def test_a_labelling_trial_repeats_bit_for_bit(small):
    trial = next(trial for _, name, trial in window._named(small) if name is None)
    first = trial.run(Path())
    assert label(Path(), **json.loads(json.dumps(trial.parameters))) == first
    assert json.loads(json.dumps(first, allow_nan=False)) == first
    assert BLIND_DRIFT in first["windows"]


def test_all_windows_of_a_cell_share_drive_and_exam():
    by_cell = {}
    for cell, name, trial in window._named(window.FULL):
        if name is not None:
            shared = json.dumps([trial.parameters[key] for key in ("lived", "exams", "marks_s", "examiner")])
            by_cell.setdefault((cell, trial.parameters["configuration"]["training"]["seed"]), set()).add(shared)
    assert len(by_cell) == 6 * 5
    assert all(len(shared) == 1 for shared in by_cell.values())
