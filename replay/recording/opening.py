"""Which kind of recording is this? Told by its first bytes, not by its name."""

import heapq
import logging
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mcap.writer import MCAP0_MAGIC

from replay.recording.message import Message, RecordingError
from replay.recording.reader import Reader
from replay.recording.report import ReadReport, Recording

logger = logging.getLogger(__name__)

_ROS1_MAGIC = b"#ROSBAG V2.0\n"
_SQLITE_MAGIC = b"SQLite format 3\0"
_METADATA = "metadata.yaml"
_KINDS = "an MCAP file, a rosbag2 folder or its .db3 file, or a .bag of ROS 1"


def read(path: str | Path) -> Recording:
    """A recording's messages in log-time order; RecordingError where it is missing, empty, of no known kind, damaged.

    An MCAP file, a rosbag2 folder (of MCAP or SQLite files, compressed or not), a single SQLite file, a ROS 1 bag.
    What a killed recorder left is read up to its last whole chunk if it is MCAP; a warning, and the report, say so.
    """
    path = Path(path)
    if path.is_dir():
        return _read_folder(path)
    try:
        with path.open("rb") as file:
            begin = file.read(len(_SQLITE_MAGIC))
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from error
    if begin.startswith(_ROS1_MAGIC):
        from replay.recording.bags import read_ros1

        return read_ros1(path)
    if begin == _SQLITE_MAGIC:
        from replay.recording.bags import read_rosbag2

        return read_rosbag2(path)
    if begin and not MCAP0_MAGIC.startswith(begin[: len(MCAP0_MAGIC)]):
        raise RecordingError(f"{path}: not a recording: it begins with {begin[:8]!r}; expected {_KINDS}")
    return Reader(path)


def _read_folder(path: Path) -> Recording:
    metadata, mcap = path / _METADATA, sorted(path.glob("*.mcap"))
    finished = metadata.exists()
    whole = _described(metadata) if finished else {}
    if mcap and str(whole.get("compression_mode", "")).lower() != "message":
        if not finished:
            logger.warning("%s: no %s: its recorder was stopped before it could finish", path, _METADATA)
        return _merged(path, [Reader(file) for file in mcap], finished=finished)
    from replay.recording.bags import read_rosbag2

    if finished:
        return read_rosbag2(path)
    if files := sorted(path.glob("*.db3")):
        logger.warning("%s: no %s: its recorder was stopped before it could finish", path, _METADATA)
        return _merged(path, [read_rosbag2(file) for file in files], finished=False)
    names = ", ".join(sorted(file.name for file in path.iterdir())[:5]) or "nothing"
    raise RecordingError(f"{path}: not a recording: the folder has {names}; expected {_KINDS}")


def _merged(path: Path, parts: list[Recording] | list[Reader], *, finished: bool) -> Recording:
    """Files that a recorder split, as one."""
    reports = [part.report for part in parts]
    last_ns = max((report.last_ns for report in reports if report.last_ns is not None), default=None)
    size_bytes, whole_bytes = sum(r.size_bytes for r in reports), sum(r.whole_bytes for r in reports)
    finished = finished and all(report.finished for report in reports)
    messages: Iterator[Message] = heapq.merge(*parts, key=lambda message: message.log_ns)
    return Recording(ReadReport(path, size_bytes, whole_bytes, finished, last_ns), messages)


def _described(metadata: Path) -> dict[str, Any]:
    """What a rosbag2 folder's metadata.yaml says."""
    from ruamel.yaml import YAML, YAMLError

    try:
        told = YAML(typ="safe").load(metadata.read_text(encoding="utf-8"))
        return dict(told["rosbag2_bagfile_information"])
    except (OSError, UnicodeDecodeError, YAMLError, KeyError, TypeError, ValueError) as error:
        raise RecordingError(
            f"{metadata}: cannot be understood ({type(error).__name__}: {error}); make it anew with `ros2 bag reindex`"
        ) from error
