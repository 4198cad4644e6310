"""What trials share on disk: made once, by whoever asks first, and never half there."""

import fcntl
import functools
import hashlib
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

#: Folders whose code decides what a trial gives.
_CODE = ("replay", "llrp_online", "agents")


def digest(*values: Any) -> str:
    """Twelve hexadecimal digits of plain values.

    >>> digest({"seed": 0, "minutes": 1.0}) == digest({"minutes": 1.0, "seed": 0})
    True
    """
    told = json.dumps(values, sort_keys=True, allow_nan=False)
    return hashlib.sha256(told.encode()).hexdigest()[:12]


@functools.cache
def code() -> str:
    """Digest of all the code that a result may depend on: twelve hexadecimal digits."""
    top = Path(__file__).parents[2]
    files = (path for folder in _CODE for path in sorted((top / folder).rglob("*.py")))
    return digest([[path.relative_to(top).as_posix(), path.read_text(encoding="utf-8")] for path in files])


def made_once(path: Path, make: Callable[[Path], object]) -> Path:
    """The file or folder `path`; if it is not there, `make(part)` writes it beside, one process at a time.

    A process that dies meanwhile lets go, and what it left is thrown away.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.with_suffix(".lock").open("wb") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not path.exists():
            part = path.with_suffix(".part")
            shutil.rmtree(part) if part.is_dir() else part.unlink(missing_ok=True)
            make(part)
            part.rename(path)
    return path
