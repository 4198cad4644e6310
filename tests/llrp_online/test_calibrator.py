"""When a calibration is fitted anew, and from what."""

import numpy as np

from llrp_online.calibrator import Calibrator
from llrp_online.configuration.learning import Calibrating
from llrp_online.prequential import Prequential

S = 10**9
SETTINGS = Calibrating(every_s=10.0, frames=400)


def prequential() -> Prequential:
    return Prequential(np.array([[0.1, 0.0, 0.0]]), ["ahead"], capacity=2000)


def pairs(of: Prequential, first: int, frames: int, probability: float, positives: float) -> None:
    """So many frames that were predicted `probability` and came out positive with this frequency."""
    for frame in range(first, first + frames):
        of.predicted(frame, np.array([[probability]], np.float32))
        label = int((frame * 7919) % 100 < 100 * positives)
        of.resolved(np.array([frame]), np.array([[[label]]], np.int8), np.array([True]))


def test_nothing_known_changes_nothing() -> None:
    calibration = Calibrator(SETTINGS, prequential()).at(0)
    assert calibration.scale.tolist() == [1.0]
    assert calibration.offset.tolist() == [0.0]


def test_it_fits_anew_when_it_is_time_and_not_before() -> None:
    known = prequential()
    calibrator = Calibrator(SETTINGS, known)
    first = calibrator.at(0)
    pairs(known, 0, 400, 0.9, 0.5)
    assert calibrator.at(9 * S) is first
    fitted = calibrator.at(10 * S)
    assert abs(float(fitted.apply(np.array([[[0.9]]]))[0, 0, 0]) - 0.5) < 0.05
    assert calibrator.newest is fitted


def test_only_the_newest_frames_count() -> None:
    known = prequential()
    calibrator = Calibrator(SETTINGS, known)
    pairs(known, 0, 400, 0.9, 0.1)
    pairs(known, 400, 400, 0.9, 0.7)
    assert abs(float(calibrator.at(0).apply(np.array([[[0.9]]]))[0, 0, 0]) - 0.7) < 0.05
