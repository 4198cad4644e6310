"""What the learner is asked while somebody watches: labels of past frames, curves, what its memory holds.

A thread of its own, since an answer may take as long as a training step; with nobody watching it asks nothing.
"""

import json
import logging
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from agents import topics
from agents.dashboard.past import Past, Pasts
from agents.transport import RequestError, Session, call, key

_LOG = logging.getLogger(__name__)
_LABELS_EVERY_S = 0.5
_CURVES_EVERY_S = 5.0
_UNFINISHED_S = 1.0
_MEMORY_EVERY_S = 5.0
_TIMEOUT_S = 5.0
#: Open frames asked about at once: the newest, and as many of the others in turn.
_NEWEST, _OTHERS = 12, 6
_PICTURES = 24
#: A frame's explanation is fetched so long before its window closes, for whoever clicks it later.
_BEFORE_END_S = 3.0


class Questions:
    """Asks the learner.

    Args:
        session: of Zenoh.
        robot: its name.
        pasts: whose labels are asked for; read and told under `lock`.
        lock: of all that the dashboard keeps.
        now_ns: the newest sensor time; None before there is one.
        settle_s: a frame's labels may change for so long.

    Attributes:
        curves: the newest answer; None before there is one.
        memory: the same.
        revision: counts the answers to these two.
    """

    def __init__(
        self,
        session: Session,
        robot: str,
        pasts: Pasts,
        lock: threading.Lock,
        now_ns: Callable[[], int | None],
        settle_s: float,
    ) -> None:
        self._session, self._key = session, key(robot, topics.LEARNER_COMMAND)
        self._pasts, self._lock, self._now_ns, self._settle_s = pasts, lock, now_ns, settle_s
        self.curves: dict[str, Any] | None = None
        self.memory: dict[str, Any] | None = None
        self.revision = 0
        self.watched = threading.Event()
        self._stop = threading.Event()
        self._turn = 0
        self._due_s = {"labels": 0.0, "curves": 0.0, "memory": 0.0}
        self._thread = threading.Thread(target=self._run, name="questions", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Ask no more."""
        self._stop.set()
        self._thread.join(_TIMEOUT_S)

    def ask(self, command: str, **arguments: object) -> Any:
        """The learner's answer; RequestError says why there is none."""
        request = json.dumps({"command": command, **arguments}).encode()
        return json.loads(call(self._session, self._key, request, _TIMEOUT_S))["result"]

    def explain(self, past: Past) -> dict[str, Any] | None:
        """Of a frame that waits, or as it was just before it closed; None where it is too late."""
        found = self.ask("explain", t_ns=past.t_ns)
        if found is not None:
            with self._lock:
                past.explanation = found
        return past.explanation

    def _run(self) -> None:
        while not self._stop.wait(0.1):
            if not self.watched.is_set():
                continue
            try:
                self._round()
            except RequestError as error:
                _LOG.debug("the learner does not answer: %s", error)
                self._stop.wait(1.0)
            except Exception:
                _LOG.exception("asking the learner has failed; going on")
                self._stop.wait(1.0)

    def _round(self) -> None:
        if self._is_due("labels", _LABELS_EVERY_S):
            self._ask_labels()
        if self._is_due("curves", _CURVES_EVERY_S):
            curves = self.ask("curves")
            self.curves = curves
            self.revision += 1
            # The learner works out a few minutes' scores at one asking: of a long run it is asked again and again.
            if any(minute["bands"] is None for minute in curves["minutes"]):
                self._due_s["curves"] = time.monotonic() + _UNFINISHED_S
        if self._is_due("memory", _MEMORY_EVERY_S):
            self.memory = self.ask("memory", pictures=_PICTURES)
            self.revision += 1

    def _is_due(self, what: str, every_s: float) -> bool:
        now_s = time.monotonic()
        if now_s < self._due_s[what]:
            return False
        self._due_s[what] = now_s + every_s
        return True

    def _ask_labels(self) -> None:
        now_ns = self._now_ns()
        with self._lock:
            open_ = [past for past in self._pasts if not past.closed]
        if now_ns is None or not open_:
            return
        others = open_[:-_NEWEST]
        self._turn += _OTHERS
        some = [others[(self._turn + i) % len(others)] for i in range(min(_OTHERS, len(others)))]
        asked = list({past.key: past for past in [*some, *open_[-_NEWEST:]]}.values())
        answers = self.ask("labels", t_ns=[past.t_ns for past in asked], ids=[past.frame_id for past in asked])
        with self._lock:
            for past, answer in zip(asked, answers, strict=True):
                age_s = (now_ns - past.t_ns) * 1e-9
                labels = None if answer is None else np.array(answer["labels"], np.int8)
                frame_id = past.frame_id if answer is None else int(answer["id"])
                # A second more than the window: the answer was asked for after the frame had closed.
                self._pasts.tell(past, labels, frame_id, closed=age_s > self._settle_s + 1.0)
        for past in asked:
            ends_soon = (now_ns - past.t_ns) * 1e-9 > self._settle_s - _BEFORE_END_S
            labels = None if past.labels is None else past.labels.tolist()
            if ends_soon and labels and (past.explanation is None or past.explanation["labels"] != labels):
                self.explain(past)
