"""One trial in a process of its own: `python -m agents.experiments.worker DRIVES < trial.json`.

Its result goes to standard output. The trial is one line; standard input then
stays open, and its end means that whoever asked is gone.
"""

import json
import os
import sys
import threading
from pathlib import Path

from agents.experiments.trial import Result, Trial


def run_alone(trial: Trial, drives: Path) -> Result:
    """The trial's result, computed in this process on one thread: how many cores there are must not change a digit."""
    import torch

    torch.set_num_threads(1)
    return trial.run(drives)


def main() -> None:
    """Read a trial, run it, print its result."""
    asked = json.loads(sys.stdin.readline())
    threading.Thread(target=_follow, daemon=True).start()
    answer, sys.stdout = sys.stdout, sys.stderr  # what a library prints is not the result
    result = run_alone(Trial(asked["work"], asked["parameters"]), Path(sys.argv[1]))
    answer.write(json.dumps(result, allow_nan=False))


def _follow() -> None:
    sys.stdin.read()
    os._exit(1)


if __name__ == "__main__":
    main()
