"""The network `online` beside the paper's: what a training step takes, and how well each predicts after one drive."""

import time

import numpy as np
import pytest

from agents import cli
from agents.commands.evaluate import exam_of
from agents.replayed import learn_over
from bench.rows import Figure, Row
from llrp_online.configuration import load
from llrp_online.configuration.learning import Network
from llrp_online.learner import Learner
from llrp_online.scoring import mean_auc
from replay.buffer import Batch

CONFIG, FARTHEST_M = "configs/thymio.toml", 0.25
PRESETS = ("online", "paper")
PAPER = "the paper's network"


@pytest.fixture
def drives(tmp_path, short):
    """A drive to learn from, and one through another layout to be judged by."""
    paths = [tmp_path / "drive.mcap", tmp_path / "held_out.mcap"]
    for seed, path in enumerate(paths):
        words = ["record", "--simulate", "--minutes", "1" if short else "5", "--seed", str(seed), "--config", CONFIG]
        assert cli.main([*words, "--output", str(path)]) == 0
    return paths


def robot(preset, seed):
    whole = load(CONFIG)
    training = whole.training.model_copy(update={"seed": seed})
    return whole.model_copy(update={"network": Network(preset=preset), "training": training})


def batch_for(configuration):
    rng = np.random.default_rng(0)
    outputs = configuration.outputs
    labels = rng.integers(-1, 2, (configuration.training.batch, *outputs)).astype(np.int8)
    pictures = rng.integers(0, 256, (len(labels), *configuration.picture_shape), dtype=np.uint8)
    return Batch(pictures, labels, np.ones(labels.shape, np.float32))


def test_online_preset(drives, record, short):
    drive, held_out = drives
    exams = {preset: exam_of(robot(preset, 0), [held_out]) for preset in PRESETS}
    seeds = range(1 if short else 3)
    step_s, missed = {preset: [] for preset in PRESETS}, {preset: [] for preset in PRESETS}
    for seed in seeds:
        learners = {preset: Learner(robot(preset, seed)) for preset in PRESETS}
        for preset, learner in learners.items():
            learn_over(learner, [drive])
            missed[preset].append(1 - mean_auc(exams[preset].score(learner.trainer.weights()), FARTHEST_M)[0])
        batch = batch_for(robot("paper", seed))
        counts = np.ones((*batch.labels.shape[1:], 2), np.int64)
        for _ in range(10 if short else 30):
            for preset, learner in learners.items():
                start = time.perf_counter()
                learner.trainer.step(batch, counts)
                step_s[preset].append(time.perf_counter() - start)
    for path, found, unit in (
        ("training step of the network `online`, batch 64, augmentation included", step_s, "s"),
        ("what the network `online` misses of a perfect AUC in another layout, after one drive", missed, "of 1"),
    ):
        note = (
            f"targets up to {FARTHEST_M} m, {len(seeds)} seeds; each seed alone: {pairs(found)}" if unit != "s" else ""
        )
        record(Row(path, Figure(found["online"]), {PAPER: Figure(found["paper"])}, {PAPER: 1.0}, unit=unit, note=note))


def pairs(missed):
    return ", ".join(f"{ours:.3f} to {papers:.3f}" for ours, papers in zip(*missed.values(), strict=True))
