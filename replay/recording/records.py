"""What is inside a chunk of an MCAP file: messages, and the schemas and channels that say what they are.

Messages are most of a file, and are picked straight out of the decompressed bytes; the rest is the library's to read.
"""

import logging
import struct
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Schema
from mcap.stream_reader import get_chunk_data_stream

from replay.recording.message import Message, RecordingError
from replay.recording.scan import HEAD, Piece

logger = logging.getLogger(__name__)

_MESSAGE = struct.Struct("<H4xQ8x")  # channel and log time; the sequence number and the time of publishing are not used


class Definitions:
    """What the channels of a file carry, as far as is known.

    Args:
        path: the file, for errors.
        schemas: by id.
        channels: by id.
    """

    def __init__(self, path: Path, schemas: dict[int, Schema], channels: dict[int, Channel]) -> None:
        self._path = path
        self._schemas, self._channels = dict(schemas), dict(channels)
        self._known: dict[int, tuple[str, str] | None] = {}
        self._left_out: set[str] = set()

    def define(self, record: Schema | Channel) -> None:
        """Remember a definition; a later one of the same id takes its place."""
        if isinstance(record, Schema):
            self._schemas[record.id] = record
        else:
            self._channels[record.id] = record
        self._known.clear()

    def of(self, channel_id: int) -> tuple[str, str] | None:
        """A channel's topic and type; None, with a warning a topic, if its encoding is another than CDR."""
        if channel_id not in self._known:
            self._known[channel_id] = self._look_up(channel_id)
        return self._known[channel_id]

    def _look_up(self, channel_id: int) -> tuple[str, str] | None:
        channel = self._channels.get(channel_id)
        schema = self._schemas.get(channel.schema_id) if channel is not None else None
        if channel is None or schema is None:
            raise RecordingError(
                f"{self._path}: damaged: a message of channel {channel_id}, which has no definition before it; "
                "copy the file again from where it was recorded"
            )
        if channel.message_encoding == "cdr":
            return channel.topic, schema.name
        if channel.topic not in self._left_out:
            self._left_out.add(channel.topic)
            encoding = channel.message_encoding
            logger.warning("%s: %s: left out: expected cdr, got %r", self._path, channel.topic, encoding)
        return None


def records_of(file: BinaryIO, piece: Piece) -> bytes:
    """The records of a chunk, decompressed and held against its check sum; or the one record outside any."""
    if not piece.is_chunk:
        file.seek(piece.offset)
        return file.read(HEAD.size + piece.length)
    file.seek(piece.offset + HEAD.size)
    chunk = Chunk.read(ReadDataStream(BytesIO(file.read(piece.length))))
    stream, length = get_chunk_data_stream(chunk, validate_crc=True)
    return stream.read(length)


def spans(records: bytes) -> Iterator[tuple[int, int, int]]:
    """Opcode, begin and end of the content of each record; EOFError where the bytes end within one."""
    begin = 0
    while begin < len(records):
        opcode, length = HEAD.unpack_from(records, begin)
        content = begin + HEAD.size
        begin = content + length
        if begin > len(records):
            raise EOFError(f"expected a record of {length} bytes, got {len(records) - content}")
        yield opcode, content, begin


def messages_in(records: bytes, definitions: Definitions) -> list[Message]:
    """The CDR messages among these records, as they stand; what is defined there goes to `definitions`."""
    found: list[Message] = []
    for opcode, begin, end in spans(records):
        if opcode == Opcode.MESSAGE:
            channel, log_ns = _MESSAGE.unpack_from(records, begin)
            if (known := definitions.of(channel)) is not None:
                found.append(Message(*known, log_ns, records[begin + _MESSAGE.size : end]))
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            stream = ReadDataStream(BytesIO(records[begin:end]))
            definitions.define(Schema.read(stream) if opcode == Opcode.SCHEMA else Channel.read(stream))
    return found
