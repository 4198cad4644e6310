"""Reading MCAP: a stream in log-time order that holds no more than the chunks whose times overlap."""

import logging
from bisect import bisect_left
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from mcap.opcode import Opcode

from replay.recording.message import Message, RecordingError
from replay.recording.records import Definitions, messages_in, records_of, spans
from replay.recording.report import ReadReport, Recording
from replay.recording.scan import Piece, scan

logger = logging.getLogger(__name__)


class Reader(Recording):
    """The messages of one MCAP file in log-time order, ties in the file's order.

    Attributes:
        report: how much of the file can be read; its `messages` counts those handed out so far.

    Opening finds what is wrong with the file as a whole; a damaged chunk is found when it is reached, after the
    messages before it were handed out. Messages of another encoding than CDR are left out, with a warning a topic.
    """

    def __init__(self, path: str | Path) -> None:
        self._path = Path(path)
        try:
            with self._path.open("rb") as file:
                layout = scan(file, self._path)
                self._definitions = Definitions(self._path, layout.schemas, layout.channels)
                self._pieces = layout.pieces
                whole_bytes = layout.whole_bytes
                if not layout.finished and not self._last_is_whole(file):
                    whole_bytes = self._pieces.pop().offset
                # A channel is defined once, before its first message in the file; read out of order, it must be known
                # beforehand.
                if any(a.start_ns > b.start_ns for a, b in zip(self._pieces, self._pieces[1:], strict=False)):
                    for piece in self._pieces:
                        self._open(file, piece)
        except OSError as error:
            raise RecordingError(f"{self._path}: cannot be read: {error.strerror}") from error
        last_ns = layout.last_ns if self._pieces else None
        report = ReadReport(self._path, layout.size_bytes, whole_bytes, layout.finished, last_ns)
        if not layout.finished:
            logger.warning("%s", report)
        super().__init__(report, self._in_order())

    def _in_order(self) -> Iterator[Message]:
        """Opens a chunk when its first log time has come; only messages that a later chunk may precede wait for it."""
        waiting: list[tuple[int, int, int, Message]] = []  # by log time, then as in the file
        order = sorted(range(len(self._pieces)), key=lambda index: self._pieces[index].start_ns)
        with self._path.open("rb") as file:
            for place in order:
                due = bisect_left(waiting, (self._pieces[place].start_ns,))
                for *_, message in waiting[:due]:
                    yield message
                del waiting[:due]
                for index, message in enumerate(self._open(file, self._pieces[place])):
                    waiting.append((message.log_ns, place, index, message))
                waiting.sort()
        for *_, message in waiting:
            yield message

    def _open(self, file: BinaryIO, piece: Piece) -> list[Message]:
        """The messages of a chunk; what it defines is remembered."""
        with self._named(piece):
            return messages_in(records_of(file, piece), self._definitions)

    def _last_is_whole(self, file: BinaryIO) -> bool:
        """After a power cut the last chunk may have its length and not its content."""
        if not self._pieces:
            return True
        try:
            with self._named(self._pieces[-1]):
                return any(opcode == Opcode.MESSAGE for opcode, *_ in list(spans(records_of(file, self._pieces[-1]))))
        except RecordingError:
            return False

    @contextmanager
    def _named(self, piece: Piece) -> Generator[None]:
        """Damaged bytes can make the decompressor and the record parsers raise almost anything: one error for all."""
        try:
            yield
        except (OSError, RecordingError):
            raise
        except Exception as error:
            raise RecordingError(
                f"{self._path}: damaged: the chunk at byte {piece.offset} cannot be read "
                f"({type(error).__name__}: {error}); copy the file again from where it was recorded"
            ) from error
