"""Bags of other kinds: SQLite files of ROS 2 and `.bag` files of ROS 1, read by rosbags.

A ROS 1 message becomes CDR by the definition that its bag carries; its header loses `seq`, which ROS 2 does not have.
"""

from collections.abc import Callable, Generator, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Protocol

from rosbags.interfaces import Connection
from rosbags.rosbag1 import Reader as Bag1
from rosbags.rosbag2 import Reader as Bag2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from replay.recording.message import Message, RecordingError
from replay.recording.report import ReadReport, Recording

_HEADER, _SEQUENCE = "std_msgs/msg/Header", "seq"
# A SQLite writer that was killed leaves its last messages in this file beside it.
_WRITE_AHEAD = "-wal"
_Convert = Callable[[bytes, str], bytes]


class _Bag(Protocol):
    """What both readers of rosbags have."""

    @property
    def connections(self) -> list[Connection]: ...

    @property
    def message_count(self) -> int: ...

    @property
    def end_time(self) -> int: ...

    def open(self) -> None: ...

    def close(self) -> None: ...

    def messages(self) -> Iterator[tuple[Connection, int, bytes]]: ...


def read_rosbag2(path: Path) -> Recording:
    """A rosbag2 folder with its metadata.yaml, or one `.db3` file of it; RecordingError says what is wrong."""
    if path.is_file() and path.suffix != ".db3":
        raise RecordingError(f"{path}: a SQLite file by its first bytes; if it is a rosbag2 file, call it .db3")
    for file in [path] if path.is_file() else sorted(path.glob("*.db3")):
        ahead = file.with_name(file.name + _WRITE_AHEAD)
        if ahead.exists() and ahead.stat().st_size:
            raise RecordingError(
                f"{file}: its recorder was stopped before it could finish, and the last messages are in {ahead.name}: "
                f'put them in with sqlite3 {file} "PRAGMA wal_checkpoint(TRUNCATE)"'
            )
    return _recording(path, lambda: Bag2(path), lambda data, _type: data)


def read_ros1(path: Path) -> Recording:
    """A `.bag` file of ROS 1; RecordingError says what is wrong."""
    types = get_typestore(Stores.EMPTY)
    known: set[str] = set(types.fielddefs)

    def open_bag() -> _Bag:
        return Bag1(path)

    def learn(bag: _Bag) -> None:
        for connection in bag.connections:
            found = get_types_from_msg(connection.msgdef.data, connection.msgtype)
            if _HEADER in found:
                constants, fields = found[_HEADER]
                found[_HEADER] = constants, [field for field in fields if field[0] != _SEQUENCE]
            types.register({name: fields for name, fields in found.items() if name not in known})
            known.update(found)

    return _recording(path, open_bag, lambda data, kind: bytes(types.ros1_to_cdr(data, kind)), learn)


def _recording(
    path: Path, make: Callable[[], _Bag], convert: _Convert, learn: Callable[[_Bag], None] = lambda _bag: None
) -> Recording:
    """Opened once for the report, and again when the first message is asked for: nobody need close it."""
    size_bytes = sum(file.stat().st_size for file in ([path] if path.is_file() else path.iterdir()) if file.is_file())
    with _named(path), _opened(make) as bag:
        learn(bag)
        last_ns = bag.end_time - 1 if bag.message_count else None
    report = ReadReport(path, size_bytes, size_bytes, finished=True, last_ns=last_ns)
    return Recording(report, _messages(path, make, convert))


def _messages(path: Path, make: Callable[[], _Bag], convert: _Convert) -> Iterator[Message]:
    with _named(path), _opened(make) as bag:
        for connection, log_ns, data in bag.messages():
            yield Message(connection.topic, connection.msgtype, log_ns, convert(data, connection.msgtype))


@contextmanager
def _opened(make: Callable[[], _Bag]) -> Generator[_Bag]:
    with ExitStack() as stack:
        bag = make()
        bag.open()
        stack.callback(bag.close)
        yield bag


@contextmanager
def _named(path: Path) -> Generator[None]:
    """Damaged bytes make the library, its database and its decompressors raise almost anything: one error for all."""
    try:
        yield
    except (RecordingError, GeneratorExit):
        raise
    except Exception as error:
        advice = "rosbag reindex" if path.suffix == ".bag" else "ros2 bag reindex"
        raise RecordingError(
            f"{path}: cannot be read ({type(error).__name__}: {error}); if its recorder was killed, mend it with "
            f"`{advice}`, else copy it again from where it was recorded"
        ) from error
