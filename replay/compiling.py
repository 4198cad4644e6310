"""Compiled kernels, kept out of a robot's way: built once, cached, and never waited for while it roams.

Where a hot path has a fast form, that form is a module with a function `build(*arguments)`, which compiles its kernels
with numba and returns them; the plain form beside it is the reference, and gives the same results. `Compiled` is the
door between the two: it hands out the kernels, or None where the reference is to be used instead.

Offline, whoever asks waits for the compiler, so that a run is the same from its first step to its last. Live, after
`never_wait()`, nobody does: a process of lowest priority compiles into the cache, the reference runs meanwhile, and the
kernels take over once they can be loaded. Without numba, or where compiling fails, the reference goes on for good; each
of these is said once.
"""

import importlib
import json
import logging
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

_LOG = logging.getLogger(__name__)
_NICENESS = 19
_Function = TypeVar("_Function", bound=Callable[..., Any])

_lock = threading.RLock()  # one compilation at a time: numba's is not made for two
_waiting = True


def never_wait() -> None:
    """From now on this process goes on with the reference while kernels are being compiled: for live agents."""
    global _waiting
    _waiting = False


def jit(signature: str | list[str], **options: Any) -> Callable[[_Function], _Function]:
    """Compile a function now for these argument types, or load it from the cache; it runs without the interpreter lock.

    Args:
        signature: numba's, such as `"void(float32[:, ::1], int64)"`, or several.
        options: numba's, beside `cache` and `nogil`.
    """
    numba: Any = importlib.import_module("numba")
    return numba.njit(signature, cache=_use_cache(), nogil=True, **options)


class Compiled:
    """The kernels of one module for one set of arguments, once they are there.

    Args:
        module: has `build(*arguments)`; imported when first asked for.
        arguments: JSON values, the shapes that kernels are made for.

    >>> Compiled("no.such.module").get() is None
    True
    """

    def __init__(self, module: str, *arguments: Any) -> None:
        self._module = module
        self._arguments = arguments
        self._kernels: Any = None
        self._begun = False

    def get(self) -> Any:
        """The kernels, or None: use the reference. The first call begins to build, and waits unless `never_wait`."""
        if not self._begun:
            self._begun = True
            if _waiting:
                self._build()
            else:
                threading.Thread(target=self._in_background, name="compiling", daemon=True).start()
        return self._kernels

    def _in_background(self) -> None:
        start_s = time.monotonic()
        with _lock:
            compiler = [sys.executable, "-m", "replay.compiling", self._module, json.dumps(self._arguments)]
            if _use_cache():  # compiled over there, it is only loaded over here
                subprocess.run(compiler, check=False, capture_output=True)
            self._build()
        if self._kernels is not None:
            _LOG.info("%s: compiled in %.1f s, in use from now on", self._module, time.monotonic() - start_s)

    def _build(self) -> None:
        with _lock:
            try:
                self._kernels = importlib.import_module(self._module).build(*self._arguments)
            except ImportError as error:
                _LOG.warning("%s: going on without compiled code, several times slower: %s", self._module, error)
            # A compiler can fail in any way, on a processor or a version that nobody tried; a robot goes on without it.
            except Exception as error:
                _LOG.warning("%s: cannot be compiled, going on without, several times slower: %r", self._module, error)


def _use_cache() -> bool:
    """Point numba to a folder where compiled code may be kept; False if there is none."""
    config: Any = importlib.import_module("numba.core.config")
    if config.CACHE_DIR:  # the user's NUMBA_CACHE_DIR, or ours from before
        return _writable(Path(config.CACHE_DIR))
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    for folder in (home / "llrp-online", Path(tempfile.gettempdir()) / f"llrp-online-{os.getuid()}"):
        if _writable(folder):
            config.CACHE_DIR = str(folder)
            return True
    return False


def _writable(folder: Path) -> bool:
    """Can it be made, is it ours alone, and can files be written there? Code is loaded from it, so others' is not."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder.stat().st_uid == os.getuid()
    except OSError:
        return False


def _compile_here(module: str, arguments: str) -> None:
    """In a process of its own: fill the cache, when nobody else wants the core."""
    os.nice(_NICENESS)
    importlib.import_module(module).build(*json.loads(arguments))


if __name__ == "__main__":
    _compile_here(*sys.argv[1:])
