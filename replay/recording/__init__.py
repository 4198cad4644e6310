"""Recordings: MCAP files of ROS 2 messages, read in log-time order, written so that a crash leaves a readable prefix.

The bytes of the messages pass through untouched; what they mean is the codec's business, which lives on the top floor.
"""

from replay.recording.message import Message, RecordingError
from replay.recording.reader import Reader, ReadReport, read
from replay.recording.writer import Writer

__all__ = ["Message", "ReadReport", "Reader", "RecordingError", "Writer", "read"]
