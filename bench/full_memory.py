"""A learner with a full memory, in a process of its own: what it takes of the machine at most, and of what.

    python bench/full_memory.py 10000 runs/full
    python bench/full_memory.py 10000 runs/full --resume

The first fills a memory of so many frames, trains, and saves a checkpoint; the second goes on from that checkpoint.
"""

import argparse
import json
from pathlib import Path

import numpy as np

from llrp_online.configuration import load
from llrp_online.learner import Learner
from replay.buffer import BufferSettings, ReplayBuffer
from replay.frame_store import bytes_of_frame

STEPS = 20


def main() -> None:
    """Print frames, bytes of a frame, and the largest resident set in bytes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("frames", type=int)
    parser.add_argument("checkpoint", type=Path)
    parser.add_argument("--resume", action="store_true")
    arguments = parser.parse_args()
    learner = learner_for(arguments.frames)
    if arguments.resume:
        learner.load(arguments.checkpoint)
    else:
        fill(learner, arguments.frames)
    for _ in range(STEPS):
        learner.step()
    if not arguments.resume:
        learner.save(arguments.checkpoint)
    shape, outputs = learner.configuration.picture_shape, learner.buffer.class_counts.shape[:2]
    found = {
        "frames": len(learner.buffer),
        "frame_bytes": bytes_of_frame(shape, (outputs[0], outputs[1])),
        "peak_bytes": peak_bytes(),
    }
    print(json.dumps(found))


def peak_bytes() -> int:
    """The largest resident set of this process; what `getrusage` tells would be the starter's, where that is larger."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith("VmHWM"))


def learner_for(frames: int) -> Learner:
    """One whose memory holds so many frames."""
    robot = load("configs/thymio.toml")
    outputs = robot.outputs
    each = ReplayBuffer(robot.picture_shape, outputs, BufferSettings(10**8)).frame_bytes
    memory = robot.memory.model_copy(update={"budget_mb": (frames + 1) * each / 1e6})
    return Learner(robot.model_copy(update={"memory": memory}))


def fill(learner: Learner, frames: int) -> None:
    """To the brim, and some more, with noise: no frame repeats another."""
    rng, outputs = np.random.default_rng(0), learner.buffer.class_counts.shape[:2]
    weight = np.ones(outputs, np.float32)
    for number in range(frames + frames // 10):
        shape = learner.configuration.picture_shape
        picture = (rng.integers(0, 128, shape) + rng.integers(0, 128)).astype(np.uint8)
        learner.buffer.add(number, picture, rng.integers(-1, 2, outputs).astype(np.int8), weight)


if __name__ == "__main__":
    main()
