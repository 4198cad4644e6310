"""Compiled kernels, kept out of a robot's way: built once, cached, and never waited for while it roams.

Where a hot path has a fast form, that form is a module with a function `build(*arguments)`, which compiles its kernels
with numba and returns them; the plain form beside it is the reference, and gives the same results. `Compiled` is the
door between the two: it hands out the kernels, or None where the reference is to be used instead.

Offline, whoever asks waits for the compiler, so that a run is the same from its first step to its last. Live, after
`never_wait()`, nobody does: a process of lowest priority compiles into the cache, the reference runs meanwhile, and the
kernels take over once they can be loaded. Without numba, or where compiling fails, the reference goes on for good. Each
of these is said. A user may also choose the reference: `use`.
"""

import functools
import hashlib
import importlib
import json
import logging
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

_LOG = logging.getLogger(__name__)
_NICENESS = 19
#: Compiling that takes longer than this is worth a word; loading from the cache takes less.
_SAY_AFTER_S = 3.0
_LOOK_EVERY_S = 0.5
_Function = TypeVar("_Function", bound=Callable[..., Any])

_lock = threading.RLock()  # one compilation at a time: numba's is not made for two
_waiting = True
_wanted = True


def use(compiled: bool) -> None:
    """From now on this process uses kernels, or the plain forms alone: what `[compute] compiled` says."""
    global _wanted
    _wanted = compiled


@contextmanager
def plainly() -> Generator[None]:
    """The plain forms alone, within."""
    before = _wanted
    use(compiled=False)
    try:
        yield
    finally:
        use(compiled=before)


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
    signatures = [signature] if isinstance(signature, str) else signature
    if isinstance(flags := options.get("fastmath"), set):
        # The cache knows a kernel by the options of those it calls too, and a set has another order in every process.
        options["fastmath"] = dict.fromkeys(sorted(flags), True)

    def compile_it(function: _Function) -> _Function:
        kernel = numba.njit(nogil=True, **options)(function)
        closed_over = _closed_over(function)
        kernel._set_uuid(f"{function.__module__}.{function.__qualname__}{closed_over}")
        if _cache() is not None:
            kernel.enable_caching()
            # The cache would know a kernel by a pickle of what it closes over. One that calls another then has another
            # key in every process, or in the first after a change; ours is by name, and a changed file voids it anyway.
            kernel._cache._index_key = functools.partial(_key, function.__code__.co_code, repr(closed_over).encode())
        for one in signatures:
            kernel.compile(one)
        kernel.disable_compile()
        return kernel

    return compile_it


def _key(code: bytes, closed_over: bytes, signature: Any, codegen: Any) -> tuple[Any, ...]:
    """Of a kernel in numba's cache: its types, the processor, what it does and what it is made for."""
    digests = tuple(hashlib.sha256(part).hexdigest() for part in (code, closed_over))
    return signature, codegen.magic_tuple(), digests


def _closed_over(function: Callable[..., Any]) -> list[str]:
    """What a kernel is made for: the constants in its closure, and the names of the kernels there."""
    cells = getattr(function, "__closure__", None) or ()
    return [str(getattr(cell.cell_contents, "_uuid", cell.cell_contents)) for cell in cells]


class Compiled:
    """The kernels of one module for one set of arguments, once they are there.

    Args:
        module: has `build(*arguments)`; imported when first asked for.
        arguments: JSON values, the shapes that kernels are made for.

    >>> Compiled("replay.no_such_module").get() is None
    True
    """

    def __init__(self, module: str, *arguments: Any) -> None:
        self._module = module
        self._arguments = json.dumps(arguments)
        self._kernels: Any = None
        self._begun = False

    def get(self) -> Any:
        """The kernels, or None: use the reference. The first call begins to build, and waits unless `never_wait`."""
        if not _wanted:
            return None
        if not self._begun:
            self._begun = True
            if _waiting:
                with _lock, self._said("the command waits"):
                    self._build()
            else:
                threading.Thread(target=self._build_in_background, name="compiling", daemon=True).start()
        return self._kernels

    def _build_in_background(self) -> None:
        _be_nice(threading.get_native_id())
        with _lock, self._said("the plain form runs meanwhile, several times slower"):
            try:
                # Compiled over there, code is only loaded over here; where there is no cache, it is compiled here.
                failure = None if _cache() is None else self._compile_elsewhere()
            except ImportError as error:
                failure = str(error)
            if failure is None:
                self._build()
            else:
                self._give_up(failure)

    def _compile_elsewhere(self) -> str | None:
        """Fill the cache in a process of its own, which may even crash; what went wrong, or None."""
        words = [sys.executable, "-m", "replay.compiling", self._module, self._arguments]
        path = os.pathsep.join(folder for folder in sys.path if folder)
        compiler = subprocess.run(
            words, check=False, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": path}
        )
        if compiler.returncode == 0:
            return None
        last_words = compiler.stderr.strip().splitlines()[-1:]
        return f"the compiler ended with {compiler.returncode}: {' '.join(last_words)}"

    def _build(self) -> None:
        try:
            try:
                self._kernels = self._tried_twice()
            except ImportError:
                raise
            # What a damaged cache makes of loading can be any error: clear it, and compile anew.
            except Exception:
                _clear_cache()
                self._kernels = _built(self._module, self._arguments)
        # A compiler can fail in any way, on a processor or a version that nobody tried; a robot goes on without it.
        except Exception as error:
            self._give_up(f"{type(error).__name__}: {error}")

    def _tried_twice(self) -> Any:
        """Another process may clear the cache just while this one writes there: that is no damage."""
        with suppress(OSError):
            return _built(self._module, self._arguments)
        return _built(self._module, self._arguments)

    def _give_up(self, reason: str) -> None:
        _LOG.warning("%s: going on without compiled code, several times slower: %s", self._module, reason)

    @contextmanager
    def _said(self, meanwhile: str) -> Generator[None]:
        """Say that compiling goes on if it does for long, and when it is done."""
        start_s = time.monotonic()
        words = "%s: compiling, once for this processor; %s"
        timer = threading.Timer(_SAY_AFTER_S, _LOG.warning, (words, self._module, meanwhile))
        timer.daemon = True
        timer.start()
        try:
            yield
        finally:
            timer.cancel()
        took_s = time.monotonic() - start_s
        if took_s > _SAY_AFTER_S and self._kernels is not None:
            _LOG.warning("%s: compiled in %.0f s and in use from now on", self._module, took_s)


@functools.cache
def _built(module: str, arguments: str) -> Any:
    """The kernels for arguments given as a JSON list; the same for all who ask in this process."""
    return importlib.import_module(module).build(*json.loads(arguments))


def _cache() -> Path | None:
    """The folder where compiled code is kept, made known to numba; None if there is none to write in."""
    config: Any = importlib.import_module("numba.core.config")
    if config.CACHE_DIR:  # the user's NUMBA_CACHE_DIR, or ours from before
        folder = Path(config.CACHE_DIR)
        return folder if _writable(folder) else None
    for folder in _cache_folders():
        if _writable(folder):
            config.CACHE_DIR = str(folder)
            return folder
    return None


def _cache_folders() -> list[Path]:
    """Where the user's caches are, or else a folder for this user among the temporary ones."""
    folders = [Path(tempfile.gettempdir()) / f"llrp-online-{os.getuid()}"]
    with suppress(RuntimeError):  # a user without a home
        folders.insert(0, Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "llrp-online")
    return folders


def _writable(folder: Path) -> bool:
    """Can it be made, is it ours, and can files be written there? Code is loaded from it: another's will not do."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder.stat().st_uid == os.getuid()
    except OSError:
        return False


def _clear_cache() -> None:
    """Forget all compiled code, unless the user said where it is kept: then other programs' code is there too."""
    folder = _cache()
    if folder is not None and not os.environ.get("NUMBA_CACHE_DIR"):
        shutil.rmtree(folder, ignore_errors=True)


def _be_nice(thread: int) -> None:
    """Let a thread (0: this process) run when nobody else wants the core."""
    with suppress(OSError, AttributeError):  # a system without priorities of threads
        os.setpriority(os.PRIO_PROCESS, thread, _NICENESS)


def _compile_here(module: str, arguments: str) -> None:
    """In a process of its own: fill the cache, and end with the process that asked for it."""
    _be_nice(0)
    parent = os.getppid()

    def end_with_parent() -> None:
        while os.getppid() == parent:
            time.sleep(_LOOK_EVERY_S)
        os._exit(1)

    threading.Thread(target=end_with_parent, daemon=True).start()
    _built(module, arguments)


if __name__ == "__main__":
    _compile_here(*sys.argv[1:])
