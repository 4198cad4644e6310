"""The learner in a background thread: sensors hand messages over and go on; the thread ingests them and trains.

One thread owns the learner and all it holds; nothing is shared and nothing is locked. What crosses is immutable: bytes
in, weights and a status out. Messages wait in a bounded queue, so a sensor never waits for a training step; should the
queue ever be full, the oldest message is dropped and counted.
"""

import contextlib
import logging
import os
import queue
import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, replace
from typing import Any

from llrp_online.events import Event
from llrp_online.learner import Learner
from llrp_online.publisher import Version
from llrp_online.status import LearnerStatus
from replay.updates import Updates

_LOG = logging.getLogger(__name__)
#: Messages that may wait: about a minute of a robot's sensors.
QUEUE = 4096
#: The thread looks up this often when nothing comes.
_IDLE_S = 0.05
#: Between two training steps it takes in half of what waits, but at least so many messages: the deeper the queue, the
#: rarer a step. A step let go can be made up for, a reading lost cannot; and no flood stops learning altogether.
_INGEST_AT_ONCE = 256
_STATUS_EVERY_S = 1.0
#: Lowest priority: perception and control come first.
_NICENESS = 19

Ingest = Callable[[Any], list[Event]]


@dataclass(frozen=True)
class Listeners:
    """Who is told, from the learner's thread; each must return quickly.

    Attributes:
        weights: a version was published.
        status: once a second.
        labels: labels became known.
    """

    weights: Callable[[Version], None] = lambda _: None
    status: Callable[[LearnerStatus], None] = lambda _: None
    labels: Callable[[Updates], None] = lambda _: None


class BackgroundLearner:
    """Runs a learner in a thread of its own; a context manager.

    Args:
        learner: from now on the thread's; reach it through `call` only.
        ingest: turns a message handed to `submit` into events, in the thread.
        listeners: who is told.
    """

    def __init__(self, learner: Learner, ingest: Ingest, listeners: Listeners | None = None) -> None:
        self._learner = learner
        self._ingest = ingest
        self._tell = listeners or Listeners()
        self._messages: deque[Any] = deque(maxlen=QUEUE)
        self._wake = threading.Event()
        self._calls: queue.SimpleQueue[tuple[Callable[[Learner], Any], Future[Any]]] = queue.SimpleQueue()
        self._stopping = threading.Event()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="learner", daemon=True)
        self._told: int | None = None
        self._status_s = 0.0
        self._rest_until_s = 0.0
        self.drops: Counter[str] = Counter()
        self.failure: BaseException | None = None

    def __enter__(self) -> "BackgroundLearner":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def backlog(self) -> int:
        """Messages that wait."""
        return len(self._messages)

    def submit(self, message: Any) -> None:
        """Hand a message over; never waits."""
        if len(self._messages) == QUEUE:
            self.drops["learner: too slow for its sensors, oldest message dropped"] += 1
        self._messages.append(message)
        self._wake.set()

    def call(self, command: Callable[[Learner], Any], timeout_s: float = 30.0) -> Any:
        """Run a command on the learner, in its thread, between two steps; its result, or its error raised here."""
        if not self._thread.is_alive():
            raise RuntimeError("the learner has stopped") from self.failure
        future: Future[Any] = Future()
        self._calls.put((command, future))
        self._wake.set()
        if self._ended.is_set():  # between the question and the call
            self._refuse_calls()
        return future.result(timeout_s)

    def stop(self, timeout_s: float = 5.0) -> None:
        """End the thread after the step it is in; what waits in the queue is left."""
        self._stopping.set()
        self._wake.set()
        self._thread.join(timeout_s)

    # --- in the thread

    def _run(self) -> None:
        _lower_priority()
        try:
            while not self._stopping.is_set():
                self._obey()
                self._take_messages()
                if self._learner.due() and time.monotonic() >= self._rest_until_s:
                    self._train()
                elif not self._messages:
                    self._wake.wait(_IDLE_S)
                self._wake.clear()
                self._tell_weights()
                self._report()
        except BaseException as error:  # a thread that dies silently looks like one that has nothing to do
            _LOG.exception("the learner's thread has failed")
            self.failure = error
        finally:
            self._ended.set()
            self._refuse_calls()

    def _obey(self) -> None:
        with contextlib.suppress(queue.Empty):
            while True:
                command, future = self._calls.get_nowait()
                try:
                    future.set_result(command(self._learner))
                except Exception as error:
                    future.set_exception(error)

    def _refuse_calls(self) -> None:
        """Nobody is left to obey: whoever waits for an answer is told, rather than left to wait."""
        with contextlib.suppress(queue.Empty):
            while True:
                self._calls.get_nowait()[1].set_exception(RuntimeError("the learner has stopped"))

    def _take_messages(self) -> None:
        waiting = len(self._messages)
        for _ in range(min(waiting, max(_INGEST_AT_ONCE, waiting // 2))):
            if self._stopping.is_set() or not self._calls.empty():
                return
            for event in self._ingest(self._messages.popleft()):
                updates = self._learner.take(event)
                if updates:
                    self._tell.labels(updates)

    def _train(self) -> None:
        start_s = time.monotonic()
        self._learner.step()
        took_s = time.monotonic() - start_s
        share = self._learner.configuration.training.core_share
        self._rest_until_s = start_s + took_s / share

    def _tell_weights(self) -> None:
        """A version may come from a step, or from a command such as roll-back."""
        newest = self._learner.publisher.newest
        if newest is not None and newest.number != self._told:
            self._told = newest.number
            self._tell.weights(newest)

    def _report(self) -> None:
        now_s = time.monotonic()
        if now_s - self._status_s < _STATUS_EVERY_S:
            return
        self._status_s = now_s
        status = self._learner.status()
        self._tell.status(replace(status, drops={**status.drops, **self.drops}, backlog=self.backlog))


def _lower_priority() -> None:
    """Let this thread run when nobody else wants the core."""
    # Where the system knows no priorities of threads, training merely competes like everyone else.
    with contextlib.suppress(OSError, AttributeError):
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _NICENESS)
