"""Work for the trials of test_experiments.py; each takes the folder of drives first."""

import os
import signal
import time
from pathlib import Path

from agents.experiments.trial import Result


def square(drives: Path, x: int) -> Result:
    print("a library that talks")
    return {"square": x * x}


def fail(drives: Path, why: str) -> Result:
    raise ValueError(why)


def die(drives: Path) -> Result:
    os.kill(os.getpid(), signal.SIGKILL)
    return {}


def die_once(drives: Path, mark: str) -> Result:
    if not Path(mark).exists():
        Path(mark).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return {"lived": True}


def wait(drives: Path, mark: str) -> Result:
    part = Path(mark).with_suffix(".part")
    part.write_text(str(os.getpid()))
    part.rename(mark)
    time.sleep(600)
    return {}
