"""A walk over an MCAP file's record headers: where its chunks are, and how far the file is whole.

The index at a file's end says the same, but only if its writer lived to write it. The walk reads a few bytes a record
and treats a finished file and a killed writer's alike.
"""

import struct
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from mcap.writer import MCAP0_MAGIC

from replay.recording.message import RecordingError

HEAD = struct.Struct("<BQ")  # a record's opcode and the length of its content
_CHUNK_TIMES = struct.Struct("<QQ")  # a chunk begins with its first and last log time
_MESSAGE_TIME = struct.Struct("<6xQ")  # a message's log time comes after its channel and sequence numbers
_LEAST_BYTES: dict[int, int] = {Opcode.CHUNK: _CHUNK_TIMES.size, Opcode.MESSAGE: _MESSAGE_TIME.size}
_PRIVATE = 0x80  # opcodes from here on are anybody's, to be skipped


class Piece(NamedTuple):
    """A chunk, or a message outside any chunk: when it starts, and where its record stands in the file."""

    start_ns: int
    offset: int
    length: int
    is_chunk: bool


@dataclass
class Layout:
    """What a scan found.

    Attributes:
        pieces: in file order.
        schemas: by id, those outside chunks.
        channels: by id, those outside chunks.
        size_bytes: of the file.
        whole_bytes: how far its records are whole.
        finished: whether its writer closed it.
        last_ns: latest log time of any piece, None where there is none.
    """

    size_bytes: int
    finished: bool
    whole_bytes: int = len(MCAP0_MAGIC)
    last_ns: int | None = None
    pieces: list[Piece] = field(default_factory=list[Piece])
    schemas: dict[int, Schema] = field(default_factory=dict[int, Schema])
    channels: dict[int, Channel] = field(default_factory=dict[int, Channel])


def scan(file: BinaryIO, path: Path) -> Layout:
    """The layout of an open file; RecordingError where it is no MCAP file, or damaged rather than unfinished."""
    layout = _begin(file, path)
    offset = layout.whole_bytes
    while offset < layout.size_bytes:
        file.seek(offset)
        head = file.read(HEAD.size + _CHUNK_TIMES.size)
        opcode, length = HEAD.unpack(head[: HEAD.size]) if len(head) >= HEAD.size else (0, 0)
        end = offset + HEAD.size + length
        known = Opcode.HEADER <= opcode <= Opcode.DATA_END or opcode >= _PRIVATE
        if not known or length < _LEAST_BYTES.get(opcode, 0) or end > layout.size_bytes:
            if layout.finished:
                raise _damaged(path, offset, f"expected a record, got opcode {opcode} and a length of {length} bytes")
            break  # the record that the writer was busy with when it was killed
        try:
            _take(layout, file, Piece(0, offset, length, opcode == Opcode.CHUNK), opcode, head[HEAD.size :])
        except (McapError, UnicodeDecodeError, struct.error) as error:
            raise _damaged(path, offset, f"the record there cannot be read ({error!r})") from error
        layout.whole_bytes = offset = end
        if opcode == Opcode.DATA_END:
            break
    if layout.finished:
        layout.whole_bytes = layout.size_bytes
    return layout


def _begin(file: BinaryIO, path: Path) -> Layout:
    size_bytes = file.seek(0, 2)
    if not size_bytes:
        raise RecordingError(f"{path}: empty: its writer was killed before the first chunk, or a copy failed")
    file.seek(0)
    magic = file.read(len(MCAP0_MAGIC))
    if magic != MCAP0_MAGIC:
        raise RecordingError(f"{path}: not an MCAP file: it begins with {magic!r}, expected {MCAP0_MAGIC!r}")
    file.seek(max(len(MCAP0_MAGIC), size_bytes - len(MCAP0_MAGIC)))
    return Layout(size_bytes, finished=file.read() == MCAP0_MAGIC)


def _damaged(path: Path, offset: int, what: str) -> RecordingError:
    return RecordingError(f"{path}: damaged at byte {offset}: {what}; copy the file again from where it was recorded")


def _take(layout: Layout, file: BinaryIO, piece: Piece, opcode: int, content: bytes) -> None:
    if opcode == Opcode.CHUNK:
        first_ns, last_ns = _CHUNK_TIMES.unpack_from(content)
    elif opcode == Opcode.MESSAGE:
        (first_ns,) = (last_ns,) = _MESSAGE_TIME.unpack_from(content)
    else:
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            file.seek(piece.offset + HEAD.size)
            stream = ReadDataStream(BytesIO(file.read(piece.length)))
            if opcode == Opcode.SCHEMA:
                schema = Schema.read(stream)
                layout.schemas[schema.id] = schema
            else:
                channel = Channel.read(stream)
                layout.channels[channel.id] = channel
        return
    layout.pieces.append(piece._replace(start_ns=first_ns))
    layout.last_ns = last_ns if layout.last_ns is None else max(layout.last_ns, last_ns)
