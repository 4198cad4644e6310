"""New weights from the learner to the perceiver: how long that takes, and whether a frame is late for it."""

import io
import time
from functools import partial
from pathlib import Path

import numpy as np
import torch

from agents import status, topics, weights
from agents.transport import State, free_endpoint, key, open_session, subscribe_state
from bench.live import Robot, together
from bench.rows import Figure, Row
from llrp_online.configuration import load
from llrp_online.network import build
from llrp_online.predictor import Predictor
from llrp_online.trainer import Trainer

CONFIG = Path("configs/thymio.toml")
#: Frames come this often, so that there are enough for a percentile; every other one while weights arrive.
FRAME_EVERY_S = 0.02
#: Weights are sent so long before their frame, at random: they arrive before, with and after it.
LEADS_S = (-0.001, 0.004)


def test_hand_over(race):
    configuration = load(CONFIG)
    outputs = configuration.outputs
    shape = (configuration.network.preset, configuration.picture_shape, outputs)
    trainer, predictor, theirs = Trainer(configuration), Predictor(*shape), build(*shape)
    size = sum(array.nbytes for array in trainer.weights().values())
    block, copy = np.ones(size, np.uint8), np.zeros(size, np.uint8)
    per = 50

    def by_us():
        for version in range(per):
            predictor.load(*weights.decode(weights.encode(trainer.weights(), version)))

    def by_torch():
        for _ in range(per):
            file = io.BytesIO()
            torch.save(trainer.network.state_dict(), file)
            file.seek(0)
            theirs.load_state_dict(torch.load(file))

    def by_memcpy():
        for _ in range(per):
            np.copyto(copy, block)

    race(
        "weight hand-over, learner to perceiver",
        by_us,
        {"torch.save, torch.load, load_state_dict": by_torch},
        {"torch.save, torch.load, load_state_dict": 10},
        limit=("one copy of the weights", by_memcpy),
        per=per,
        rounds=20,
        note=f"{size / 1e6:.2f} MB, each time a new average of the weights, checked to be finite and to fit",
    )


def until(moment_s):
    time.sleep(max(moment_s - time.monotonic(), 0.0))


def sent(robot, due_s, put=None, lead_s=0.0):
    """The stamp of the frame sent at `due_s`, with new weights put around it."""
    if put is not None and lead_s >= 0:
        until(due_s - lead_s)
        put()
    until(due_s)
    stamp = robot.tick()
    if put is not None and lead_s < 0:
        until(due_s - lead_s)
        put()
    return stamp


def test_no_frame_is_late_for_new_weights(tmp_path, record, short):
    blocks, frames = (3, 100) if short else (8, 250)
    configuration, endpoint = load(CONFIG), free_endpoint()
    name, random = configuration.robot.name, np.random.default_rng(0)
    arrays, version, used = Trainer(configuration).weights(), 1, []
    perceiver = together(CONFIG, tmp_path, endpoint, name, perceiver=("perceive",))
    with perceiver as session, open_session(endpoint, hub=False, name="learner") as other:
        robot, sender = Robot(session, name), State(other, key(name, topics.WEIGHTS), "")
        subscribe_state(
            session, key(name, topics.PERCEIVER_STATUS), lambda m: used.append(status.decode(m.data)["version"])
        )
        sender.put(weights.encode(arrays, version))
        while not robot.latencies_s:
            robot.live(1.0)
        late, usual = [], []
        for _ in range(blocks):
            with_new, without = [], []
            due_s = time.monotonic() + FRAME_EVERY_S
            for _ in range(frames):
                without.append(sent(robot, due_s))
                version += 1
                put = partial(sender.put, weights.encode(arrays, version))
                with_new.append(sent(robot, due_s + FRAME_EVERY_S, put, random.uniform(*LEADS_S)))
                due_s += 2 * FRAME_EVERY_S
            usual.append(robot.answers(without))
            late.append(robot.answers(with_new))
        time.sleep(1.0)  # a status, at least
    assert used[-1] == version
    usual_p99, late_p99 = (Figure([float(np.percentile(some, 99)) for some in kind]) for kind in (usual, late))
    record(
        Row(
            "frame to prediction while weights arrive, p99",
            late_p99,
            {"the same, no new weights": usual_p99},
            {"the same, no new weights": 1 / 1.2},
            note=(
                f"p99 of blocks of {frames} frames, {blocks} of each kind; medians "
                f"{1e3 * np.median(np.concatenate(late)):.2f} ms and {1e3 * np.median(np.concatenate(usual)):.2f} ms; "
                "new weights within milliseconds of every other frame, 25 times a second"
            ),
        )
    )
