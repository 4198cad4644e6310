"""One trial in a process of its own: `python -m agents.experiments.worker DRIVES < trial.json`.

Its result goes to standard output. The trial is one line; standard input then
stays open, and its end means that whoever asked is gone.
"""

import json
import os
import sys
import threading
import time
from dataclasses import asdict
from pathlib import Path

from agents.experiments.trial import Done, Trial


def run_alone(trial: Trial, drives: Path) -> Done:
    """The trial, computed in this process on one thread: how many cores there are must not change a digit."""
    import torch

    torch.set_num_threads(1)
    begun_s = time.process_time()
    return Done(trial.run(drives), time.process_time() - begun_s)


def main() -> None:
    """Read a trial, run it, print its result."""
    asked = json.loads(sys.stdin.readline())
    threading.Thread(target=_follow, daemon=True).start()
    answer, sys.stdout = sys.stdout, sys.stderr  # what a library prints is not the result
    done = run_alone(Trial(asked["work"], asked["parameters"]), Path(sys.argv[1]))
    answer.write(json.dumps(asdict(done), allow_nan=False))


def _follow() -> None:
    sys.stdin.read()
    os._exit(1)


if __name__ == "__main__":
    main()
