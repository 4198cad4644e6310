"""When probabilities are calibrated anew as the robot roams: every few seconds, by what it met last."""

from llrp_online.calibration import Calibration
from llrp_online.configuration.learning import Calibrating
from llrp_online.prequential import Prequential


class Calibrator:
    """The newest calibration, fitted anew when it is time.

    Its pairs are predictions of uncalibrated weights, each made before the network was trained on the frame.

    Args:
        settings: `[calibration]`.
        prequential: whose pairs it fits.

    >>> import numpy as np
    >>> calibrator = Calibrator(Calibrating(), Prequential(np.array([[0.1, 0, 0]]), ["ahead"], capacity=10))
    >>> calibrator.at(0).scale
    array([1.])
    """

    def __init__(self, settings: Calibrating, prequential: Prequential) -> None:
        self._settings, self._prequential = settings, prequential
        self._fitted_ns: int | None = None
        self.newest = Calibration.identity(len(prequential.band_of_target))

    def at(self, t_ns: int) -> Calibration:
        """What holds at a moment of the robot's life; it never goes back."""
        if self._fitted_ns is None or t_ns - self._fitted_ns >= self._settings.every_s * 1e9:
            self._fitted_ns = t_ns
            pairs = self._prequential.pairs(self._settings.frames)
            # A restarted learner knows nothing yet: until it does, what it was given holds.
            if (pairs[1] >= 0).any():
                self.newest = Calibration.fit(*pairs, self._prequential.band_of_target)
        return self.newest
