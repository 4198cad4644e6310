"""The trial that labels one drive by every window, and holds each label against the truth."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.experiments.drives import Drive
from agents.experiments.trial import Result, Trial
from agents.experiments.truth import NOWHERE, Truth, driven
from llrp_online import windows
from llrp_online.configuration import RobotConfiguration
from llrp_online.windows import DRIFT, Tally
from replay import compiling
from replay.resolution import Labels, resolve
from replay.sightings import sightings

#: The drift window where the odometry brings no covariance, and the noise of its steps is the configuration's default.
BLIND_DRIFT = "drift, no covariance"


def labelling(drive: Drive) -> Trial:
    """A trial of `label`."""
    return Trial("agents.experiments.labelling:label", {"drive": drive.as_json()})


def label(_folder: Path, drive: Mapping[str, Any]) -> Result:
    """Label a drive by every window.

    Args:
        drive: a `Drive` as JSON values; its pictures are not needed, so it is not recorded.

    Returns:
        `windows`: name -> what `judged` gives; `recommended`: the fixed window that the robot itself would recommend,
        which does not know the truth (`llrp window`); None where it cannot tell.
    """
    form = RobotConfiguration.model_validate(drive["configuration"])
    compiling.use(form.compute.compiled)
    known = driven(Drive.of(drive))
    truth = Truth(form, known.layout).labels(known.frames)
    targets, streams = form.targets.build(), list(form.streams.values())
    rule, limits, noise = form.labels.rule(), form.odometry.limits(), form.odometry.noise()
    compared = windows.rules(rule)
    told: dict[str, dict[str, Any]] = {}
    tallies: dict[str, Tally] = {}
    for name, (arrays, one) in {
        **{name: (known.arrays, one) for name, one in compared.items()},
        BLIND_DRIFT: (known.arrays._replace(covariances=None), compared[DRIFT]),
    }.items():
        labels = resolve(arrays, targets, streams, one, limits, noise)
        told[name] = judged(labels, truth)
        if one.window == "fixed":
            tallies[name] = Tally.of(labels, streams)
    by_age = windows.correlations(windows.felt_twice(sightings(known.arrays, streams, rule, limits, noise)))
    if by_age is None:
        return {"windows": told, "recommended": None}
    worths = {name: windows.worth(tally, by_age) for name, tally in tallies.items()}
    return {"windows": told, "recommended": windows.recommended(worths)}


def judged(found: Labels, truth: NDArray[np.int8]) -> dict[str, Any]:
    """Labels beside the truth.

    Args:
        found: of F frames.
        truth: (F, T, S) int8: 1, 0, or `NOWHERE`.

    Returns:
        `known` and `positive` labels a frame; the share `contradicted` by the truth of all, of the `positives` and of
        the `negatives`, and of all by their `weighted` count; the share that lies `nowhere`; `true_worth`: how many
        faultless labels a frame those known are worth. None where there is nothing to share.
    """
    known, positive = found.labels >= 0, found.labels == 1
    wrong = known & (found.labels != truth)
    frames = max(int(found.posed.sum()), 1)
    # Where no robot can stand, the truth is whatever the label is not.
    said, is_so = positive[known], (positive ^ wrong)[known]
    alike = float(np.corrcoef(said, is_so)[0, 1]) if 0 < said.mean() < 1 and 0 < is_so.mean() < 1 else 0.0
    return {
        "known": int(known.sum()) / frames,
        "positive": int(positive.sum()) / frames,
        "contradicted": _share(wrong, known),
        "positives": _share(wrong & positive, positive),
        "negatives": _share(wrong & ~positive, known & ~positive),
        "weighted": _share(wrong * found.weight, found.weight),
        "nowhere": _share(known & (truth == NOWHERE), known),
        "true_worth": int(known.sum()) / frames * alike**2,
    }


def _share(part: NDArray[Any], whole: NDArray[Any]) -> float | None:
    total = float(whole.sum(dtype=np.float64))
    return float(part.sum(dtype=np.float64)) / total if total else None
