"""Ctrl-C and SIGTERM as an event that a program waits for."""

import os
import signal
import threading
from collections.abc import Generator
from contextlib import contextmanager
from types import FrameType

_NUMBERS = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def ended_by_signals() -> Generator[threading.Event]:
    """An event that SIGINT and SIGTERM set while the block lasts; for the main thread alone.

    A thread of its own sets it. A handler runs in the middle of whatever the main thread does; where that is a wait for
    this very event, a handler that set it could wait for a lock which its own thread holds, and for ever.

    >>> with ended_by_signals() as stop:
    ...     signal.raise_signal(signal.SIGTERM)
    ...     stop.wait(5.0)
    True
    """
    stop = threading.Event()
    listened, told = os.pipe()
    os.set_blocking(told, False)
    listener = threading.Thread(target=_listen, args=(listened, stop), name="signals", daemon=True)
    listener.start()
    told_before = signal.set_wakeup_fd(told, warn_on_full_buffer=False)
    before = {number: signal.signal(number, _hear) for number in _NUMBERS}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        signal.set_wakeup_fd(told_before)
        os.close(told)
        listener.join()


def _hear(_number: int, _frame: FrameType | None) -> None:
    """Python writes the number into the pipe by itself, if there is a handler."""


def _listen(listened: int, stop: threading.Event) -> None:
    while numbers := os.read(listened, 16):
        if any(number in _NUMBERS for number in numbers):
            stop.set()
    os.close(listened)
