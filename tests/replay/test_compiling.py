"""Compiled code and what may be wrong around it: no numba, no cache, another processor, damaged files, a crash."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from replay import compiling

_KERNELS = """
import os
from types import SimpleNamespace
from replay.compiling import jit

def build(factor):
    if "CRASH" in os.environ:
        os.abort()

    @jit("float64(float64)", fastmath={"reassoc", "nsz", "contract", "arcp"})
    def scaled(x):
        return factor * x

    @jit("float64(float64)")
    def twice_scaled(x):
        return scaled(x) + scaled(x)

    return SimpleNamespace(run=twice_scaled, scaled=scaled)
"""
_USE = """
import json, logging, sys, threading
logging.basicConfig(level=logging.WARNING)
from replay import compiling
if "live" in sys.argv:
    compiling.never_wait()
handle = compiling.Compiled("kernels", 3)
first = handle.get()
for thread in threading.enumerate():
    if thread.name == "compiling":
        thread.join(60)
kernels = handle.get()
each = [] if kernels is None else [kernel.stats for kernel in vars(kernels).values()]
stats = [(one.cache_hits.total(), one.cache_misses.total()) for one in each]
print(json.dumps({"at_once": first is not None, "result": kernels and kernels.run(5.0), "stats": stats}))
"""


@pytest.fixture
def used(tmp_path):
    """Uses a module of kernels in a process of its own, with a home of its own; what came of it."""
    (tmp_path / "kernels.py").write_text(_KERNELS)
    home = tmp_path / "home"
    home.mkdir()

    def use(*words: str, **environment: str) -> dict:
        inherited = {k: v for k, v in os.environ.items() if not k.startswith(("NUMBA", "XDG"))}
        paths = os.pathsep.join([environment.pop("FIRST", ""), str(tmp_path), str(Path.cwd())]).lstrip(os.pathsep)
        process = subprocess.run(
            [sys.executable, "-c", _USE, *words],
            env={**inherited, "HOME": str(home), "TMPDIR": str(tmp_path), "PYTHONPATH": paths, **environment},
            capture_output=True,
            text=True,
            check=True,
            timeout=120,
        )
        return {**json.loads(process.stdout), "said": process.stderr}

    use.home = home
    return use


def test_compiled_once_and_then_loaded_though_one_kernel_calls_another(used):
    first, second = used(), used()
    assert first["result"] == second["result"] == 30.0
    assert first["stats"] == [[0, 1], [0, 1]]
    assert second["stats"] == [[1, 0], [1, 0]]
    assert second["said"] == ""


def test_live_nobody_waits_and_the_kernels_come_later_from_the_process_that_compiled_them(used):
    live = used("live")
    assert not live["at_once"]
    assert live["result"] == 30.0
    assert live["stats"] == [[1, 0], [1, 0]]  # loaded: compiled elsewhere


def test_a_home_that_cannot_be_written_in(used):
    used.home.rmdir()
    used.home.write_text("no folder")  # as root, a folder's mode would forbid nothing
    assert used()["result"] == 30.0
    assert used()["stats"] == [[1, 0], [1, 0]]  # kept among the temporary files


def test_no_place_to_write_at_all(used):
    used.home.rmdir()
    used.home.write_text("no folder")
    for words in ((), ("live",)):
        nowhere = used(*words, NUMBA_CACHE_DIR=str(used.home / "cache"))
        assert nowhere["result"] == 30.0
        assert nowhere["stats"] == [[0, 1], [0, 1]]  # compiled here and now, and forgotten


def test_a_changed_processor_gets_code_of_its_own(used):
    before = used(NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="")
    after = used()
    assert before["result"] == after["result"] == 30.0
    assert after["stats"] == [[0, 1], [0, 1]]
    assert used(NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="")["stats"] == [[1, 0], [1, 0]]


def test_a_damaged_cache_is_cleared(used):
    used()
    kept = list(used.home.rglob("*.nb?"))
    assert kept
    for file in kept:
        file.write_bytes(file.read_bytes()[:20])
    assert used()["result"] == 30.0
    assert used()["stats"] == [[1, 0], [1, 0]]


def test_without_numba_the_reference_goes_on_and_says_so(used, tmp_path):
    (tmp_path / "first").mkdir()
    (tmp_path / "first" / "numba.py").write_text('raise ImportError("no numba here")')
    for words in ((), ("live",)):
        without = used(*words, FIRST=str(tmp_path / "first"))
        assert without["result"] is None
        assert "going on without compiled code, several times slower" in without["said"]
        assert "no numba here" in without["said"]


def test_a_compiler_that_crashes_takes_nobody_with_it(used):
    crashed = used("live", CRASH="1")
    assert crashed["result"] is None
    assert "the compiler ended with -6" in crashed["said"]


def test_the_plain_forms_can_be_chosen():
    handle = compiling.Compiled("agents.robots.simulated.kernels")
    with compiling.plainly():
        assert handle.get() is None
    assert handle.get() is not None
