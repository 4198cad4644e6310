"""Trials in processes of this machine, each its own: one that dies costs its trial only, and is asked for again."""

import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import suppress
from pathlib import Path

from agents.experiments.trial import Done, Trial

#: How often a trial is begun: a process can be lost to the machine's memory or to a person; a third loss is no chance.
_TRIES = 3


class TrialError(RuntimeError):
    """A trial that failed; the message names it and ends with what it said last."""


class Local:
    """Runs trials in so many processes at once; a context manager that ends them all.

    Args:
        processes: at once.
        drives: folder of the drives that trials share.
    """

    def __init__(self, processes: int, drives: Path) -> None:
        self._drives, self._stopping = drives, False
        self._running: set[subprocess.Popen[str]] = set()
        self._changing = threading.Lock()
        self._pool = ThreadPoolExecutor(processes)

    def run(self, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Done]]:
        """Each trial with what came of it, as they end. TrialError if one fails."""
        waiting: dict[Future[Done], Trial] = {self._pool.submit(self._one, trial): trial for trial in trials}
        while waiting:
            for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                yield waiting.pop(future), future.result()

    def __enter__(self) -> "Local":
        return self

    def __exit__(self, *_: object) -> None:
        with self._changing:
            self._stopping = True
            for process in self._running:
                process.kill()
        self._pool.shutdown(cancel_futures=True)

    def _one(self, trial: Trial) -> Done:
        said = ""
        for _ in range(_TRIES):
            code, result, said = self._asked(trial)
            if code == 0:
                return Done(**json.loads(result))
            if code > 0 or self._stopping:
                break
        raise TrialError(f"trial {trial.name} failed; its parameters: {json.dumps(trial.parameters)[:300]}\n{said}")

    def _asked(self, trial: Trial) -> tuple[int, str, str]:
        """Exit code (negative: killed by that signal), standard output, the end of standard error."""
        with self._changing:
            if self._stopping:
                raise TrialError("stopped")
            process = subprocess.Popen(
                [sys.executable, "-m", "agents.experiments.worker", str(self._drives)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                env={**os.environ, "OMP_NUM_THREADS": "1"},
                start_new_session=True,  # Ctrl-C comes to the command alone, which ends them
            )
            self._running.add(process)
        assert process.stdin
        assert process.stdout
        assert process.stderr
        try:
            process.stdin.write(json.dumps({"work": trial.work, "parameters": trial.parameters}) + "\n")
            process.stdin.flush()
            # Not `communicate`: it would close the standard input, whose end tells the worker that nobody waits.
            with ThreadPoolExecutor(1) as reading:
                said = reading.submit(process.stderr.read)
                result = process.stdout.read()
            return process.wait(), result, said.result()[-2000:]
        except BrokenPipeError:
            return process.wait(), "", process.stderr.read()[-2000:]
        finally:
            with self._changing:
                self._running.discard(process)
            for stream in (process.stdin, process.stdout, process.stderr):
                with suppress(BrokenPipeError):
                    stream.close()
