"""Trials on a Ray cluster: the same work, the same results; a lost worker costs its trials only."""

import importlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from agents.experiments.local import TrialError
from agents.experiments.trial import Done, Trial
from agents.experiments.worker import run_alone
from agents.extras import install

#: A trial whose worker was lost is begun again this often.
_RETRIES = 5


class Cluster:
    """Runs trials on a Ray cluster; a context manager that leaves it.

    Args:
        address: of the cluster, as `ray.init` takes it: `auto`, or `HOST:PORT` of its head.
        drives: folder of the drives that trials share, made on each machine.
    """

    def __init__(self, address: str, drives: Path) -> None:
        try:
            self._ray: Any = importlib.import_module("ray")
        except ImportError as error:
            raise ImportError(f"--ray needs Ray: {install('cluster')}") from error
        self._drives = drives
        self._ray.init(address=address, log_to_driver=False)

    def run(self, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Done]]:
        """Each trial with what came of it, as they end. TrialError if one fails."""
        work = self._ray.remote(num_cpus=1, max_retries=_RETRIES)(run_alone)
        waiting = {work.remote(trial, self._drives): trial for trial in trials}
        while waiting:
            (done,), _ = self._ray.wait(list(waiting), num_returns=1)
            trial = waiting.pop(done)
            try:
                yield trial, self._ray.get(done)
            except self._ray.exceptions.RayError as error:
                raise TrialError(f"trial {trial.name} failed on the cluster: {error}") from error

    def __enter__(self) -> "Cluster":
        return self

    def __exit__(self, *_: object) -> None:
        self._ray.shutdown()
