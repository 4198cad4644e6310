"""Putting off Ctrl-C and SIGTERM while a record is half written.

Python raises KeyboardInterrupt between any two steps of the main thread. In the middle of a chunk that would leave
bytes which no closing can mend, so it waits the few microseconds until the record is whole.
"""

import signal
import threading
from collections.abc import Generator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def whole() -> Generator[None, None, None]:
    """Lets SIGINT and SIGTERM take effect only after the block; nothing to do outside the main thread.

    >>> try:
    ...     with whole():
    ...         signal.raise_signal(signal.SIGINT)
    ...         print("the record is whole")
    ... except KeyboardInterrupt:
    ...     print("and now the interrupt")
    the record is whole
    and now the interrupt
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    # One inside the other, so that the outer is given back even if the inner's signal raises on its way out.
    with _held(signal.SIGINT), _held(signal.SIGTERM):
        yield


@contextmanager
def _held(number: signal.Signals) -> Generator[None, None, None]:
    before = signal.getsignal(number)
    if not callable(before):  # nothing Python would raise: the default for SIGTERM ends the process at once
        yield
        return
    came = False

    def remember(_number: int, _frame: FrameType | None) -> None:
        nonlocal came
        came = True

    signal.signal(number, remember)
    try:
        yield
    finally:
        signal.signal(number, before)
        if came:
            signal.raise_signal(number)
