"""What any recording is to whoever reads it: messages in log-time order, and a report of how much there is."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from replay.recording.message import Message


@dataclass
class ReadReport:
    """How much of a file could be read; as a sentence with `str`.

    Attributes:
        path: the file, or the folder.
        size_bytes: its size.
        whole_bytes: how far it is whole; the same as `size_bytes` if it was closed by its writer.
        finished: whether its writer closed it.
        last_ns: latest log time that can be read, None where no message can.
        messages: handed out so far.
    """

    path: Path
    size_bytes: int
    whole_bytes: int
    finished: bool
    last_ns: int | None
    messages: int = 0

    @property
    def lost_bytes(self) -> int:
        """Bytes after the last whole chunk, which cannot be read."""
        return self.size_bytes - self.whole_bytes

    def __str__(self) -> str:
        if self.finished:
            return f"{self.path}: finished, {self.size_bytes} bytes"
        reach = "no message can be read" if self.last_ns is None else f"messages up to {self.last_ns / 1e9:.3f} s"
        return (
            f"{self.path}: unfinished, its writer was stopped before it could close it: "
            f"{self.whole_bytes} of {self.size_bytes} bytes are whole ({reach}), "
            f"the last {self.lost_bytes} bytes are lost"
        )


class Recording(Iterator[Message]):
    """The messages of one recording in log-time order.

    Args:
        report: how much of it can be read.
        messages: in order.

    Attributes:
        report: its `messages` counts those handed out so far.

    >>> report = ReadReport(Path("a"), 1, 1, finished=True, last_ns=5)
    >>> next(Recording(report, iter([Message("/odom", "nav_msgs/msg/Odometry", 5, b"")]))).log_ns, report.messages
    (5, 1)
    """

    report: ReadReport

    def __init__(self, report: ReadReport, messages: Iterator[Message]) -> None:
        self.report = report
        self._messages = messages

    def __next__(self) -> Message:
        message = next(self._messages)
        self.report.messages += 1
        return message
