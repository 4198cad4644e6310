"""Reading MCAP: a stream in log-time order that holds no more than the chunks whose times overlap."""

import logging
from collections.abc import Iterator
from dataclasses import dataclass
from heapq import heapify, heappop, heappush
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.records import Channel, Chunk, Schema
from mcap.records import Message as Record
from mcap.stream_reader import breakup_chunk

from replay.recording.message import Message, RecordingError
from replay.recording.scan import HEAD, Piece, scan

logger = logging.getLogger(__name__)


@dataclass
class ReadReport:
    """How much of a file could be read; as a sentence with `str`.

    Attributes:
        path: the file.
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


class Reader(Iterator[Message]):
    """The messages of one file in log-time order, ties in the file's order.

    Attributes:
        report: how much of the file can be read; its `messages` counts those handed out so far.

    Opening finds what is wrong with the file as a whole; a damaged chunk is found when it is reached, after the
    messages before it were handed out. Messages of another encoding than CDR are left out, with a warning a topic.
    """

    report: ReadReport

    def __init__(self, path: str | Path) -> None:
        self._path = Path(path)
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._left_out: set[str] = set()
        try:
            with self._path.open("rb") as file:
                layout = scan(file, self._path)
                self._schemas, self._channels = layout.schemas, layout.channels
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
        self.report = ReadReport(self._path, layout.size_bytes, whole_bytes, layout.finished, last_ns)
        if not layout.finished:
            logger.warning("%s", self.report)
        self._messages = self._merge()

    def __next__(self) -> Message:
        message = next(self._messages)
        self.report.messages += 1
        return message

    def _merge(self) -> Iterator[Message]:
        """Opens a chunk when its first log time has come: a heap of unopened chunks and of the open ones' messages."""
        heap: list[tuple[int, int, int, Piece | Record]] = [(p.start_ns, i, -1, p) for i, p in enumerate(self._pieces)]
        heapify(heap)
        with self._path.open("rb") as file:
            while heap:
                _, order, _, item = heappop(heap)
                if isinstance(item, Piece):
                    for index, record in enumerate(self._open(file, item)):
                        heappush(heap, (record.log_time, order, index, record))
                elif (message := self._message(item)) is not None:
                    yield message

    def _open(self, file: BinaryIO, piece: Piece) -> list[Record]:
        """The messages of a chunk; what it defines is remembered."""
        try:
            file.seek(piece.offset + HEAD.size)
            stream = ReadDataStream(BytesIO(file.read(piece.length)))
            if not piece.is_chunk:
                return [Record.read(stream, piece.length)]
            records = breakup_chunk(Chunk.read(stream), validate_crc=True)
        except OSError:
            raise
        # Damaged bytes can make the decompressor and the record parsers raise almost anything.
        except Exception as error:
            raise RecordingError(
                f"{self._path}: damaged: the chunk at byte {piece.offset} cannot be read "
                f"({type(error).__name__}: {error}); copy the file again from where it was recorded"
            ) from error
        for record in records:
            if isinstance(record, Schema):
                self._schemas[record.id] = record
            elif isinstance(record, Channel):
                self._channels[record.id] = record
        return [record for record in records if isinstance(record, Record)]

    def _last_is_whole(self, file: BinaryIO) -> bool:
        """After a power cut the last chunk may have its length and not its content."""
        try:
            return not self._pieces or bool(self._open(file, self._pieces[-1]))
        except RecordingError:
            return False

    def _message(self, record: Record) -> Message | None:
        channel = self._channels.get(record.channel_id)
        schema = self._schemas.get(channel.schema_id) if channel is not None else None
        if channel is None or schema is None:
            raise RecordingError(
                f"{self._path}: damaged: a message of channel {record.channel_id}, which has no definition before it; "
                "copy the file again from where it was recorded"
            )
        if channel.message_encoding != "cdr":
            if channel.topic not in self._left_out:
                self._left_out.add(channel.topic)
                encoding = channel.message_encoding
                logger.warning("%s: %s: left out: expected cdr, got %r", self._path, channel.topic, encoding)
            return None
        return Message(channel.topic, schema.name, record.log_time, record.data)


def read(path: str | Path) -> Reader:
    """A file's messages in log-time order; RecordingError where it is missing, empty, no MCAP file or damaged.

    The file of a killed writer is read up to its last whole chunk; a warning, and the reader's `report`, say how much.
    """
    return Reader(path)
