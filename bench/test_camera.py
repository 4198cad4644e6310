"""A camera message on its way to the trajectory store, beside the OpenCV calls that no program can do without.

A drive is taken in message by message, as the learner does, so that caches are as warm as on a robot and no warmer; of
each picture OpenCV decodes, resizes and converts the same bytes, by turns before and after.
"""

import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from agents import messages
from agents.intake import Intake
from bench.rows import Figure, Row
from bench.synthetic import PICTURE_TOPIC, drive
from llrp_online.configuration import load
from llrp_online.labeller import Labeller
from llrp_online.synchroniser import Synchroniser

SIZE = (80, 64)


def by_opencv(jpeg):
    decoded = cv2.imdecode(jpeg, cv2.IMREAD_COLOR)
    small = cv2.resize(decoded, SIZE, interpolation=cv2.INTER_LINEAR)
    return cv2.cvtColor(small, cv2.COLOR_BGR2RGB)


@pytest.mark.parametrize("size", [SIZE, (320, 240)], ids="{0[0]}x{0[1]}".format)
def test_camera_message_to_store(record, short, size):
    configuration = load(Path("configs/thymio.toml"))
    intake, labeller, synchroniser = Intake(configuration), Labeller(configuration), Synchroniser(1, 0.02)
    opencv, synchronised, stored = [], [], []

    def by_us(message):
        start = time.perf_counter()
        [picture] = intake.events(message.topic, message.type, message.data, message.log_ns)
        [frame] = synchroniser.add(picture)
        synchronised.append(time.perf_counter() - start)
        labeller.take(picture)
        stored.append(time.perf_counter() - start)
        return frame.picture

    def by_peer(message):
        jpeg = messages.decode(message.type, message.data).data
        start = time.perf_counter()
        found = by_opencv(jpeg)
        opencv.append(time.perf_counter() - start)
        return found

    for message in drive(20 if short else 120, size):
        if message.topic == PICTURE_TOPIC:
            turns = (by_us, by_peer) if len(opencv) % 2 else (by_peer, by_us)
            np.testing.assert_array_equal(*(turn(message) for turn in turns))
        else:
            for event in intake.events(message.topic, message.type, message.data, message.log_ns):
                labeller.take(event)
    name = "x".join(map(str, size))
    peers = {"OpenCV alone": Figure(opencv)}
    note = f"{len(opencv)} messages of {len(message.data) // 1000} kB; network size 80x64"
    record(
        Row(f"camera message to frame, {name} JPEG", Figure(synchronised), peers, {"OpenCV alone": 1 / 1.3}, note=note)
    )
    note += "; the store's part is label resolution, a path of its own"
    record(Row(f"camera message to trajectory store, {name} JPEG", Figure(stored), peers, note=note))
