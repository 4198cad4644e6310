"""`llrp train`: learn offline from stored recordings, the paper's way: label everything, then take steps over it."""

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

from agents.commands import options
from agents.offline import labelled_frames
from agents.progress import track, track_recordings
from llrp_online import checkpoint
from llrp_online.configuration import RobotConfiguration
from llrp_online.digest import weights_sha256
from llrp_online.trainer import Trainer
from replay.buffer import BufferSettings, ReplayBuffer

#: 15 epochs of 1,000 steps (Nava et al. 2019, section IV-E).
STEPS = 15_000
#: The offline buffer draws from all frames alike; this few stay apart as "recent", which it never draws from.
_RECENT = 8


def configure(parser: argparse.ArgumentParser) -> None:
    """Its words."""
    options.add_recordings(parser)
    options.add_config(parser)
    options.add_output(parser, "checkpoint directory; `llrp learn --warm-start` takes it, memory included")
    options.add_json(parser)
    parser.add_argument(
        "--steps", type=options.whole(0), default=STEPS, help=f"training steps (default {STEPS}, the paper's)"
    )
    parser.epilog = "example:\n  llrp train A.mcap B.mcap --config configs/drone.toml --output runs/offline"


def run(arguments: argparse.Namespace) -> int:
    """Label, train, save."""
    configuration = options.load_configuration(arguments)
    options.make_folder(arguments.output.parent)
    checkpoint.must_be_free(arguments.output)
    buffer = remember(configuration, arguments.recordings)
    trainer, loss = trained(configuration, buffer, arguments.steps)
    weights = trainer.weights()
    save(arguments.output, configuration, trainer, buffer)
    summary = {
        "frames": len(buffer),
        "known_labels": int(buffer.class_counts.sum()),
        "steps": trainer.steps,
        "loss": loss,
        "weights_sha256": weights_sha256(weights),
    }
    if arguments.json:
        print(json.dumps(summary))
    else:
        last = "" if loss is None else f", last loss {loss:.4f}"
        print(f"{trainer.steps} steps over {len(buffer)} frames{last}; saved to {arguments.output}")
    return 0


def trained(configuration: RobotConfiguration, buffer: ReplayBuffer, steps: int) -> tuple[Trainer, float | None]:
    """A trainer after so many steps over the buffer, and its last loss (None without a step)."""
    trainer, loss, counts = Trainer(configuration), None, buffer.class_counts
    for _ in track(range(steps), "training", steps):
        batch = buffer.sample(configuration.training.batch)
        if batch is None:
            raise ValueError("no labelled frame to train on: see `llrp check RECORDING` for the cause")
        loss = trainer.step(batch, counts)
    return trainer, loss


def remember(configuration: RobotConfiguration, recordings: list[Path]) -> ReplayBuffer:
    """All labelled frames of recordings, within the configured budget."""
    memory = configuration.memory
    settings = BufferSettings(
        budget_bytes=round(memory.budget_mb * 1e6),
        recent_frames=_RECENT,
        recent_share=0.0,
        policy=memory.policy,
        max_uses=int(np.iinfo(np.int32).max),
        positives_floor=memory.positives_floor,
        duplicate_distance=0.0,
        seed=configuration.training.seed,
    )
    buffer = ReplayBuffer(configuration.picture_shape, configuration.outputs, settings)
    frame_id = 0
    for path, told in track_recordings(recordings, "labelling"):
        for frame in labelled_frames(configuration, path, told):
            if (frame.labels >= 0).any():
                buffer.add(frame_id, frame.picture, frame.labels, frame.weight)
                frame_id += 1
    return buffer


def save(path: Path, configuration: RobotConfiguration, trainer: Trainer, buffer: ReplayBuffer) -> None:
    """Write what `llrp evaluate` and a warm start need."""
    training, values = trainer.state()
    memory = buffer.state()
    tensors: dict[str, dict[str, Any]] = {"weights": dict(trainer.weights()), "training": training, "memory": memory}
    manifest = {
        "configuration": configuration.model_dump(mode="json"),
        "version": 1,
        "training": values,
        "memory_random": buffer.random_state(),
        "next_id": int(memory["ids"].max(initial=-1)) + 1,
    }
    checkpoint.save(path, tensors, manifest, {"frames": buffer.shards()})
