"""`llrp label` over a recording, beside reading and decoding alone, as anyone would with the rosbags library."""

import subprocess
import sys
import time
from pathlib import Path

import cv2
from rosbags.highlevel import AnyReader

from agents import messages
from agents.offline import labels_of
from bench.rows import Figure, Growth, Row
from bench.synthetic import RATE_HZ, drive
from llrp_online.configuration import load
from replay.recording import Writer

CONFIG = Path("configs/thymio.toml")


def recorded(path: Path, minutes: float) -> Path:
    with Writer(path, messages.definition) as writer:
        for message in drive(60 * minutes):
            writer.write(message)
    return path


def by_rosbags(path: Path) -> int:
    """Read and decode each message, and each picture; nothing is made of it."""
    pictures = 0
    with AnyReader([path]) as reader:
        for connection, _, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            if connection.msgtype == "sensor_msgs/msg/CompressedImage":
                cv2.cvtColor(cv2.imdecode(message.data, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)
                pictures += 1
    return pictures


def by_us(path: Path) -> int:
    return sum(len(part) for part in labels_of(load(CONFIG), path))


def seconds(work, path: Path) -> float:
    start = time.perf_counter()
    assert work(path) > 0
    return time.perf_counter() - start


def test_recording_read_back(tmp_path, record, short):
    minutes = 1 if short else 60
    path, ours, theirs = recorded(tmp_path / "drive.mcap", minutes), [], []
    by_us(recorded(tmp_path / "warm.mcap", 0.1))
    for turn in range(3):
        pair = [(by_us, ours), (by_rosbags, theirs)]
        for work, found in pair if turn % 2 else reversed(pair):
            found.append(seconds(work, path))
    record(
        Row(
            f"recording read back and labelled, {minutes} min at {RATE_HZ} Hz",
            Figure(ours),
            {"rosbags AnyReader, messages and pictures decoded": Figure(theirs)},
            {"rosbags AnyReader, messages and pictures decoded": 1 / 1.2},
            gaps={"rosbags AnyReader, messages and pictures decoded": "each picture costs three calls in Python"},
            note=f"{path.stat().st_size / 1e6:.0f} MB; {minutes * 60 * RATE_HZ} pictures of 80x64",
        )
    )


MEASURED = """
import re, sys
from pathlib import Path
from bench.test_recording import by_us
by_us(Path(sys.argv[1]))
print(re.search(r"VmHWM:\\s+(\\d+)", Path("/proc/self/status").read_text())[1])  # not what a parent once had
"""


def test_growth_of_reading_back(tmp_path, record, short):
    lengths = (0.5, 5) if short else (3, 30)
    times, peaks = [], []
    for minutes in lengths:
        path = recorded(tmp_path / f"{minutes}.mcap", minutes)
        times.append(Figure([seconds(by_us, path) for _ in range(3)]))
        told = subprocess.run([sys.executable, "-c", MEASURED, str(path)], check=True, capture_output=True, text=True)
        peaks.append(Figure([float(told.stdout) * 1024]))
    record(Growth("recording read back and labelled", "minutes", lengths, times, 1.1))
    record(Growth("recording read back, peak resident set", "minutes", lengths, peaks, 0.15, unit="bytes"))
