"""Writing MCAP: ROS 2 profile, CDR, zstd, small chunks, each on the disk's doorstep as soon as it is full."""

from collections.abc import Callable
from pathlib import Path

from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter

from replay.closing import Closing
from replay.recording.interrupts import whole
from replay.recording.message import Message, RecordingError

# A killed writer loses the chunk it was filling: at the library's 1 MiB that was 61 messages of 333, at this size 3.
CHUNK_BYTES = 64 * 1024


class Writer(Closing):
    """A recording being written.

    Args:
        path: a file that does not exist yet; its folder does.
        definitions: gives a type's full definition in `ros2msg`, and raises for a type it does not know.

    Attributes:
        path: the file.
        messages: written so far.

    As a context manager it closes the file on every way out, Ctrl-C among them. After a crash the file is readable up
    to its last whole chunk. Not for two threads at once.

    >>> import tempfile
    >>> from replay.recording import read
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "run.mcap"
    ...     with Writer(path, lambda type_name: "bool data") as writer:
    ...         writer.write(Message("/bump", "std_msgs/msg/Bool", 7, bytes([0, 1, 0, 0, 1])))
    ...     [message.log_ns for message in read(path)]
    [7]
    """

    def __init__(self, path: str | Path, definitions: Callable[[str], str]) -> None:
        self.path = Path(path)
        self.messages = 0
        self._definitions = definitions
        self._channels: dict[tuple[str, str], int] = {}
        self._schemas: dict[str, int] = {}
        self._failed = False
        try:
            self._file = self.path.open("xb")
        except FileExistsError as error:
            raise RecordingError(
                f"{self.path}: exists already, and a recording is never overwritten; remove it or name another file"
            ) from error
        except OSError as error:
            raise RecordingError(f"{self.path}: cannot be written: {error.strerror}") from error
        self._mcap = McapWriter(self._file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
        with whole():
            try:
                self._mcap.start(profile="ros2", library="llrp-online")
                self._file.flush()
            except OSError as error:
                self._failed = True
                self._close_file()
                raise RecordingError(f"{self.path}: cannot be written: {error.strerror}") from error

    def write(self, message: Message) -> None:
        """Append a message; RecordingError if the disk refuses it, after which nothing more can be written."""
        if self._file.closed or self._failed:
            raise RecordingError(f"{self.path}: cannot be written: it is closed, or an earlier write failed")
        if not 0 <= message.log_ns < 2**64:
            raise RecordingError(
                f"{self.path}: {message.topic}: log time {message.log_ns} ns: expected 0 or more, below 2**64"
            )
        # Asked for here: an unknown type must raise before anything of it is written.
        known = message.type in self._schemas
        definition = "" if known else self._definitions(message.type)
        with whole():
            try:
                if not known:
                    schema = self._mcap.register_schema(message.type, "ros2msg", definition.encode())
                    self._schemas[message.type] = schema
                self._mcap.add_message(self._channel(message), message.log_ns, message.data, message.log_ns)
                self._file.flush()
            except OSError as error:
                self._failed = True
                raise RecordingError(
                    f"{self.path}: cannot be written: {error.strerror}; it is readable up to here"
                ) from error
        self.messages += 1

    def close(self) -> None:
        """Write the index and close; a second call does nothing."""
        if self._file.closed:
            return
        with whole():
            try:
                if not self._failed:
                    self._mcap.finish()
            except OSError as error:
                self._failed = True
                raise RecordingError(
                    f"{self.path}: cannot be closed: {error.strerror}; it is readable up to its last whole chunk"
                ) from error
            finally:
                self._close_file()

    def _channel(self, message: Message) -> int:
        key = message.topic, message.type
        if key not in self._channels:
            self._channels[key] = self._mcap.register_channel(message.topic, "cdr", self._schemas[message.type])
        return self._channels[key]

    def _close_file(self) -> None:
        try:
            self._file.close()
        except OSError:
            # Closing flushes what a full disk has refused once already, and that error has been raised.
            if not self._failed:
                raise
