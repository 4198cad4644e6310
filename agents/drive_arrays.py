"""A recording as plain arrays, for those who label it again and again."""

from collections import Counter
from pathlib import Path

import numpy as np

from agents.intake import Intake
from agents.offline import messages_of, report_drops
from agents.progress import Share, nobody
from llrp_online.configuration import RobotConfiguration
from llrp_online.events import OdometrySample, Picture, Reading
from llrp_online.synchroniser import Synchroniser
from replay.resolution import Drive


def drive_of(configuration: RobotConfiguration, path: Path, told: Share = nobody) -> Drive:
    """All of a recording that labels hang on, each part in order of its sensor's time.

    What a live labeller drops because it comes late is kept: here everything is in memory. Of two samples with one time
    the first counts. The covariance is None as soon as one sample lacks it, or the configuration does not trust it.
    `told` hears how much of the recording is over.

    MissingTopicsError if the configuration's topics never came; ValueError if nothing of a kind could be used.
    """
    intake = Intake(configuration)
    frames = Synchroniser(len(configuration.camera), configuration.robot.camera_sync_s)
    odometry: dict[int, OdometrySample] = {}
    readings: dict[tuple[int, str], Reading] = {}
    frames_ns: set[int] = set()
    drops: Counter[str] = Counter()
    for message, share in messages_of(path, intake):
        told(share)
        for event in intake.events(message.topic, message.type, message.data, message.log_ns):
            if isinstance(event, Picture):
                frames_ns.update(frame.t_ns for frame in frames.add(event))
            elif isinstance(event, Reading):
                readings.setdefault((event.t_ns, event.topic), event)
            elif np.isfinite(event.pose).all():
                odometry.setdefault(event.t_ns, event)
            else:
                drops["odometry: not a number"] += 1
    report_drops(path, intake.drops + drops)
    for what, found in (("odometry", odometry), ("short-range reading", readings), ("frame", frames_ns)):
        if not found:
            raise ValueError(f"{path}: not one usable {what}; expected some. See `llrp check {path}` for the cause")
    return _arrays(
        configuration, [odometry[t] for t in sorted(odometry)], [readings[key] for key in sorted(readings)], frames_ns
    )


def _arrays(
    configuration: RobotConfiguration, odometry: list[OdometrySample], readings: list[Reading], frames_ns: set[int]
) -> Drive:
    streams = configuration.streams
    topics = list(streams)
    bits = np.full((len(readings), max(map(len, streams.values()))), -1, np.int8)
    for row, reading in enumerate(readings):
        members = streams[reading.topic]
        bits[row, : len(members)] = reading.bits[members]
    given = [sample.covariance for sample in odometry if sample.covariance is not None]
    trusted = configuration.odometry.trust_covariance and len(given) == len(odometry)
    return Drive(
        np.array([sample.t_ns for sample in odometry], np.int64),
        np.array([sample.pose for sample in odometry], np.float64),
        np.array(given, np.float64) if trusted else None,
        np.array([reading.t_ns for reading in readings], np.int64),
        np.array([topics.index(reading.topic) for reading in readings], np.int64),
        bits,
        np.array(sorted(frames_ns), np.int64),
    )
