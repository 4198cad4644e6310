"""`llrp experiment`: a study with figures and a page, repeatable and resumable."""

import argparse
import importlib
import logging
import os
from pathlib import Path

from agents.commands import options
from agents.progress import track

_LOG = logging.getLogger(__name__)
#: Name -> module of `agents.experiments` with `FULL`, `QUICK`, `trials(size)` and `findings(size, results)`.
STUDIES = {
    "scratch": "from nothing in an unseen scenario: AUC against robot minutes; controllers; steps a second",
    "crossval": "the paper's experiment: train offline on eight scenarios, test on two; and leave one out",
    "adapt": "a new floor: warm-started with and without the memory, beside frozen and from nothing",
    "control": "driving on predictions: collisions by minutes learned; what avoiding does to the labels",
    "calibration": "do probabilities mean what they say: ECE by distance, before and after online scaling",
    "window": "how long to trust odometry: labels, their truth and the AUC they lead to, by window",
    "ablate": "each choice of the learner alone: loss, memory, augmentation, network, averaging",
    "pioneer": "the paper's second robot: three cameras, a floor sensor, 289 targets; offline and in one pass online",
    "robustness": "camera pose, exposure, blur, shadows, a person: how far the AUC falls, and how soon it is back",
}


def configure(parser: argparse.ArgumentParser) -> None:
    """Its words."""
    parser.add_argument(
        "study", choices=tuple(STUDIES), help="; ".join(f"{name}: {story}" for name, story in STUDIES.items())
    )
    parser.add_argument("--output", type=Path, help="folder (default: runs/experiments/STUDY, with -quick if so)")
    parser.add_argument("--quick", action="store_true", help="a small form that shows that it runs; minutes, not hours")
    parser.add_argument(
        "--processes", type=options.whole(1), default=os.cpu_count() or 1, help="trials at once (default: one a core)"
    )
    parser.add_argument("--ray", metavar="ADDRESS", help="run the trials on this Ray cluster (extra `cluster`)")
    parser.add_argument("--results", type=Path, metavar="RESULTS.md", help="write the study's part of this page anew")
    parser.epilog = (
        "Trials that have ended are kept: a study that was stopped goes on from them.\n\n"
        "examples:\n  llrp experiment scratch --quick\n  llrp experiment scratch --results docs/RESULTS.md"
    )


def run(arguments: argparse.Namespace) -> int:
    """Run what is missing, then write it all down."""
    from agents.experiments import results
    from agents.experiments.cluster import Cluster
    from agents.experiments.findings import write
    from agents.experiments.local import Local
    from agents.experiments.trial import Shelf

    study = importlib.import_module(f"agents.experiments.{arguments.study}")
    size = study.QUICK if arguments.quick else study.FULL
    output = arguments.output or Path("runs/experiments") / (arguments.study + ("-quick" if arguments.quick else ""))
    options.make_folder(output)
    shelf, drives, trials = Shelf(output / "trials"), (output.parent / "drives").resolve(), study.trials(size)
    missing = [trial for trial in trials if shelf.get(trial) is None]
    if missing:
        runner = Cluster(arguments.ray, drives) if arguments.ray else Local(arguments.processes, drives)
        with runner:
            for trial, done in track(runner.run(missing), arguments.study, len(missing)):
                shelf.put(trial, done)
    if stale := shelf.of_other_code(trials):
        _LOG.warning(
            "%d of %d trials were kept from other code than is here now; to run them anew, delete %s",
            stale,
            len(trials),
            output / "trials",
        )
    found = study.findings(size, [shelf.get(trial) for trial in trials])
    page = write(found, output, size.seeds)
    for claim in found.claims:
        print("  ".join(cell for cell in claim.row() if cell))
    cost = f"{len(trials)} trials, {shelf.computing_s(trials) / 60:.0f} minutes of one core"
    cost += f", {stale} of them by an earlier state of the code" if stale else ""
    cost += f"; seeds {', '.join(map(str, size.seeds))}"
    print(f"{cost}. {len(missing)} run now, {len(trials) - len(missing)} kept from before; see {page}")
    if arguments.results:
        results.put(arguments.results, arguments.study, found, cost)
    return 0
