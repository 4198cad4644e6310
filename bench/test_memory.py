"""The replay buffer beside torchrl's, cpprb's and a plain copy; its growth; and what a full memory takes."""

import json
import subprocess
import sys
import time

import cpprb
import numpy as np
import pytest
import torch
from tensordict import TensorDict
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer

from bench.rows import Figure, Growth, Row
from replay.buffer import BufferSettings, ReplayBuffer
from replay.frame_store import bytes_of_frame

PICTURE, LABELS, BATCH = (64, 80, 3), (31, 5), 64
#: What is known to stop it.
DRAWING = {
    "memcpy": "frames drawn lie anywhere in 800 MB, those copied side by side; it is half of a copy, give or take"
}
_CHECKS = "a frame that retires is compared with the last 1,024 and weighed against 64 others, which a ring does not do"
ADDING = {"cpprb": _CHECKS, "memcpy": _CHECKS}
#: A robot that sees 20 frames a second and takes 5 steps.
NEW = 4
SMALL = (8, 8, 3)
#: Frames that differ: more than the buffer looks back for repetitions.
MANY = 2048


def frames(rng, count, picture=PICTURE):
    """Pictures, labels of which a third is unknown, weights."""
    labels = rng.integers(-1, 2, (count, *LABELS)).astype(np.int8)
    return rng.integers(0, 256, (count, *picture), dtype=np.uint8), labels, rng.random(labels.shape, np.float32)


def full(capacity, picture=PICTURE):
    """A buffer that is full, its settings the defaults, and what adds a few new frames to it."""
    each = ReplayBuffer(picture, LABELS, BufferSettings(10**8)).frame_bytes
    # Frames are added without end and drawn without end here: none may be used up.
    buffer = ReplayBuffer(picture, LABELS, BufferSettings((capacity + 1) * each, max_uses=2**31 - 1))
    some, number = frames(np.random.default_rng(0), MANY, picture), 0

    def add(count):
        nonlocal number
        for _ in range(count):
            k = number % MANY
            buffer.add(number, some[0][k], some[1][k], some[2][k])
            number += 1

    # Noise looks alike once it is averaged; but labels differ, and a frame comes again only when it is long forgotten.
    while len(buffer) < capacity:
        add(100)
    return buffer, add


def with_torchrl(capacity, some):
    buffer = TensorDictReplayBuffer(storage=LazyTensorStorage(capacity), batch_size=BATCH)
    names = ("picture", "labels", "weight")
    new = TensorDict(dict(zip(names, map(torch.from_numpy, some), strict=True)), batch_size=[len(some[0])])
    while len(buffer) < capacity:
        buffer.extend(new)
    return lambda: [buffer.add(new[k]) for k in range(NEW)], buffer.sample


def with_cpprb(capacity, some, *, at_once):
    buffer = cpprb.ReplayBuffer(
        capacity,
        {
            "picture": {"shape": PICTURE, "dtype": np.uint8},
            "labels": {"shape": LABELS, "dtype": np.int8},
            "weight": {"shape": LABELS, "dtype": np.float32},
        },
    )
    names = ("picture", "labels", "weight")
    new = dict(zip(names, some, strict=True))
    size = NEW if at_once else 1
    few = [{name: part[k : k + size] for name, part in new.items()} for k in range(0, NEW, size)]
    while buffer.get_stored_size() < capacity:
        buffer.add(**new)
    return lambda: [buffer.add(**part) for part in few], lambda: buffer.sample(BATCH)


def copied(count, rng, arrays):
    """As many bytes as so many frames, from anywhere in the memory to one place."""
    places = [np.empty((count, *array.shape[1:]), array.dtype) for array in arrays]

    def work():
        begin = rng.integers(0, len(arrays[0]) - count)
        for place, array in zip(places, arrays, strict=True):
            np.copyto(place, array[begin : begin + count])

    return work


def looked_at(batch):
    """All of a batch, copied out of the memory."""
    return batch.pictures, batch.labels, batch.weight


@pytest.mark.parametrize("what", ["64 drawn", f"{NEW} frames added, 64 drawn"])
def test_replay(race, short, what):
    torch.set_num_threads(1)
    capacity, adding = 5_000 if short else 50_000, what != "64 drawn"
    rng = np.random.default_rng(1)
    some = frames(rng, 500)
    buffer, add = full(capacity)
    peers = {
        "torchrl": with_torchrl(capacity, some),
        "cpprb": with_cpprb(capacity, some, at_once=False),
    }
    if adding:  # not what a robot can do: its frames come one by one
        peers["cpprb, the frames added at once"] = with_cpprb(capacity, some, at_once=True)

    def both(put, draw):
        def work():
            for _ in range(10):
                if adding:
                    put()
                draw()

        return work

    copy = copied(BATCH + NEW * adding, rng, buffer.sample(1).frames)
    race(
        f"replay, {what}",
        both(lambda: add(NEW), lambda: looked_at(buffer.sample(BATCH))),
        {
            **{name: both(*verbs) for name, verbs in peers.items()},
            "memcpy": lambda: [copy() for _ in range(10)],
        },
        {"torchrl": 1.0, "cpprb": 1.0, "memcpy": 0.5},
        per=10,
        rounds=40,
        note=f"full memory of {capacity:,} frames of {' x '.join(map(str, PICTURE))} with 31 x 5 labels and weights",
        gaps=ADDING if adding else DRAWING,
    )


def test_growth_with_frames_remembered(record, short):
    sizes = [5_000, 50_000] if short else [50_000, 500_000]
    figures = []
    for size in sizes:
        buffer, add = full(size, SMALL)
        seconds = []
        for _ in range(200):
            start = time.perf_counter()
            add(NEW)
            looked_at(buffer.sample(BATCH))
            seconds.append(time.perf_counter() - start)
        figures.append(Figure(seconds))
    name = f"replay, {NEW} frames added, 64 drawn ({' x '.join(map(str, SMALL))} pictures)"
    record(Growth(name, "frames remembered", sizes, figures, most=0.15))


def peak(frames_kept, checkpoint, *words):
    command = [sys.executable, "bench/full_memory.py", str(frames_kept), str(checkpoint), *words]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return json.loads(done.stdout)


@pytest.mark.parametrize("words", [(), ("--resume",)], ids=["saved", "resumed"])
def test_bytes_a_frame(record, short, tmp_path, words):
    """The slope over three sizes: what is there without any frame does not count."""
    sizes = [1_500, 3_000, 6_000] if short else [5_000, 15_000, 30_000]
    found = []
    for size in sizes:
        alive = peak(size, tmp_path / "checkpoint")
        found.append(peak(size, tmp_path / "checkpoint", *words) if words else alive)
    kept, peaks = ([one[name] for one in found] for name in ("frames", "peak_bytes"))
    slope, constant = np.polyfit(kept, peaks, 1)
    own = bytes_of_frame(PICTURE, LABELS)
    assert slope > 0.9 * own, "less than the frames themselves: this does not measure what it should"
    assert {one["frame_bytes"] for one in found} == {own}
    record(
        Row(
            f"peak resident set a frame, learner with a full memory, {'resumed' if words else 'saved'}",
            Figure([float(slope)]),
            limit=("the frame itself", Figure([float(own)])),
            most=1.25 * own,
            unit="B",
            note=f"{constant / 1e6:.0f} MB without frames; memories of {sizes} frames",
        )
    )
