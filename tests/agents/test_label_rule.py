"""`llrp label` against the rule read in plain Python, through files: random drives, written as MCAP and labelled."""

import json

import numpy as np
import pytest

from agents import messages
from agents.cli import main
from llrp_online.configuration import load
from llrp_online.events import OdometrySample
from replay.recording import Message, Writer
from tests.replay import brute
from tests.replay.worlds import drive, mail

CONFIGURATION = """
[robot]
name = "r"
[[camera]]
topic = "camera"
width = 16
height = 16
type = "sensor_msgs/msg/Image"
[odometry]
max_gap_s = 0.35
max_delay_s = 0.8
[[short_range]]
name = "left"
topic = "near"
field = "ranges[1]"
below = 0.5
swap = "right"
[[short_range]]
name = "right"
topic = "near"
field = "ranges[0]"
below = 0.5
swap = "left"
[[short_range]]
name = "ahead"
topic = "far"
field = "ranges[0]"
below = 0.5
swap = "ahead"
[targets]
kind = "line"
start_m = 0.0
stop_m = 0.6
step_m = 0.1
[labels]
position_tolerance_m = 0.12
heading_tolerance_rad = 0.31
window_s = 3.0
"""
STREAMS = [[0, 1], [2]]


def ros(event):
    """An event as a message; the stamp is the sensor's, the log time that of arrival."""
    if isinstance(event, brute.Odometry):
        return "/r/odom", messages.odometry(OdometrySample(event.t_ns, np.array(event.pose)))
    if isinstance(event, brute.Frame):
        return "/r/camera", messages.image(event.t_ns, np.zeros((16, 16, 3), np.uint8))
    metres = [{1: 0.1, 0: np.inf, -1: np.nan}[bit] for bit in reversed(event.bits)]
    return ("/r/near", "/r/far")[event.stream], messages.laser_scan(event.t_ns, metres, (-0.3, 0.3), (0.0, 1.0))


@pytest.mark.parametrize("seed", range(6))
def test_every_label_of_a_random_recording_equals_the_rule(tmp_path, capsys, seed):
    rng = np.random.default_rng(seed)
    config = tmp_path / "robot.toml"
    config.write_text(CONFIGURATION)
    events = sorted((e for part in drive(rng, 12.0, STREAMS) for e in part), key=lambda e: e.t_ns)
    if seed % 2:
        events = mail(rng, events, max_delay_s=0.8)
    with Writer(tmp_path / "drive.mcap", messages.definition) as writer:
        for arrival, event in enumerate(events):
            topic, message = ros(event)
            writer.write(Message(topic, message.__msgtype__, 10**12 + arrival, messages.encode(message)))
    words = [
        "label",
        str(tmp_path / "drive.mcap"),
        "--config",
        str(config),
        "--output",
        str(tmp_path / "l.npz"),
        "--json",
    ]
    assert main(words) == 0
    said = np.load(tmp_path / "l.npz")

    configuration = load(config)
    rule, limits = configuration.labels.rule(), configuration.odometry.limits()
    kinds = [[e for e in events if isinstance(e, kind)] for kind in (brute.Odometry, brute.Reading, brute.Frame)]
    odometry, readings, frames = kinds
    targets = configuration.targets.build().poses
    answers = {f.t_ns: brute.labels(f, odometry, readings, targets, STREAMS, rule, limits) for f in frames}
    posed = sorted(t_ns for t_ns, answer in answers.items() if answer is not None)
    assert said["t"].tolist() == [t_ns / 1e9 for t_ns in posed]
    for t_ns, labels in zip(posed, said["labels"], strict=True):
        assert brute.accepts(answers[t_ns], labels, STREAMS), f"frame at {t_ns}"
    assert json.loads(capsys.readouterr().out)["known_labels"] == (said["labels"] >= 0).sum() > 0
    np.testing.assert_array_equal(said["weight"], said["labels"] >= 0)
