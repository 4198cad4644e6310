"""Recordings: ROS 2 messages, read in log-time order; written as MCAP, so that a crash leaves a readable prefix.

Read are MCAP files, rosbag2 folders and ROS 1 bags.

The bytes of the messages pass through untouched; what they mean is the codec's business, which lives on the top floor.
"""

from replay.recording.message import Message, RecordingError
from replay.recording.opening import read
from replay.recording.reader import Reader
from replay.recording.report import ReadReport, Recording
from replay.recording.writer import Writer

__all__ = ["Message", "ReadReport", "Reader", "Recording", "RecordingError", "Writer", "read"]
