"""`llrp explain` against `llrp label` and the rule read in plain Python: random drives, frame by frame."""

import json

import numpy as np
import pytest

from agents import messages
from agents.cli import main
from agents.commands.label import as_arrays
from agents.explaining import explain_at
from agents.offline import labels_of
from llrp_online.configuration import load
from replay.recording import Message, Writer
from tests.agents.test_label_rule import CONFIGURATION, STREAMS, ros
from tests.replay import brute
from tests.replay.worlds import drive, mail


def recorded(folder, seed, window="fixed"):
    """A configuration, a recording of a random drive, and its events in order of time."""
    rng = np.random.default_rng(seed)
    config, path = folder / "robot.toml", folder / "drive.mcap"
    config.write_text(CONFIGURATION + f'window = "{window}"\ngate_m = 0.2\n')
    events = sorted((e for part in drive(rng, 12.0, STREAMS) for e in part), key=lambda e: e.t_ns)
    mailed = mail(rng, events, max_delay_s=0.8) if seed % 2 else events
    with Writer(path, messages.definition) as writer:
        for arrival, event in enumerate(mailed):
            topic, message = ros(event)
            writer.write(Message(topic, message.__msgtype__, 10**12 + arrival, messages.encode(message)))
    return load(config), path, events


@pytest.mark.parametrize(("seed", "window"), [(0, "fixed"), (1, "fixed"), (2, "drift"), (3, "drift")])
def test_it_agrees_with_the_labels_of_every_frame(tmp_path, seed, window):
    configuration, path, _ = recorded(tmp_path, seed, window)
    labels = as_arrays(labels_of(configuration, path), configuration.outputs)
    begin_s = explain_at(configuration, path, 0.0)[0].t_ns / 1e9
    known = 0
    for row in range(0, len(labels["t"]), 3):
        found, at_s = explain_at(configuration, path, float(labels["t"][row]) - begin_s)
        assert found.t_ns / 1e9 == labels["t"][row]
        assert at_s == pytest.approx(labels["t"][row] - begin_s)
        np.testing.assert_array_equal(found.labels, labels["labels"][row])
        np.testing.assert_array_equal(found.weight, labels["weight"][row])
        assert (found.reading_ns[found.labels >= 0] >= 0).all()
        known += int((found.labels >= 0).sum())
    assert known > 30


def test_it_names_the_reading_that_the_rule_chooses(tmp_path):
    configuration, path, events = recorded(tmp_path, 4)
    rule, limits = configuration.labels.rule(), configuration.odometry.limits()
    odometry, readings, frames = (
        [e for e in events if isinstance(e, kind)] for kind in (brute.Odometry, brute.Reading, brute.Frame)
    )
    targets = configuration.targets.build().poses
    chosen = 0
    for frame in frames[::4]:
        found, _ = explain_at(configuration, path, (frame.t_ns - frames[0].t_ns) * 1e-9)
        answer = brute.labels(frame, odometry, readings, targets, STREAMS, rule, limits)
        assert (found.pose is None) == (answer is None)
        for (stream, target), winners in (answer or {}).items():
            times = {-1 if w is None else w.t_ns for w in winners}
            assert set(found.reading_ns[target, STREAMS[stream]].tolist()) <= times
            chosen += winners != [None]
        within = found.reading_ns >= 0
        assert (found.distance_m[within] <= rule.position_tolerance_m).all()
        assert (np.abs(found.turned_rad[within]) <= rule.heading_tolerance_rad).all()
        assert (np.abs(found.reading_ns - frame.t_ns)[within] <= rule.window_ns).all()
    assert chosen > 10


def test_what_odometry_knows_falls_with_the_way_between(tmp_path):
    configuration, path, _ = recorded(tmp_path, 0)
    apart, deviation = [], []
    for at_s in np.arange(2.0, 9.0, 0.5):
        found, _ = explain_at(configuration, path, float(at_s))
        within = found.reading_ns >= 0
        apart += np.abs(found.reading_ns - found.t_ns)[within].tolist()
        deviation += found.deviation_m[within].tolist()
    assert np.isfinite(deviation).all()
    assert np.corrcoef(apart, deviation)[0, 1] > 0.5
    still = np.array(apart) == 0
    assert (np.array(deviation)[still] < 1e-9).all()


def test_the_command_prints_a_table_or_json(tmp_path, capsys):
    configuration, path, _ = recorded(tmp_path, 0)
    words = ["explain", str(path), "--config", str(tmp_path / "robot.toml"), "--at", "5"]
    assert main([*words, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    found, at_s = explain_at(configuration, path, 5.0)
    assert told["at_s"] == at_s
    assert told["labels"] == found.labels.tolist()
    assert told["sensors"] == ["left", "right", "ahead"]
    assert [when is None for when in told["reading_ns"][0]] == (found.reading_ns[0] < 0).tolist()
    assert main(words) == 0
    shown = capsys.readouterr().out
    assert f"{int((found.labels >= 0).sum())} of {found.labels.size} labels known" in shown
    assert "known to" in shown
