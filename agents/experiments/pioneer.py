"""The paper's second instance: a Pioneer on a black and white floor, 289 targets, cell by cell beside the paper's.

Nava et al. 2019, section V-C. What the paper leaves open (the noise, the cameras) is in `configs/worlds/pioneer.toml`.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from agents.experiments import pioneer_figures as figures
from agents.experiments.findings import Claim, Findings, Plot, Table
from agents.experiments.pioneer_cells import Cells
from agents.experiments.pioneer_drives import PioneerDrive
from agents.experiments.pioneer_published import Published, published
from agents.experiments.pioneer_rig import rig
from agents.experiments.settings import CONFIGS, changed, configuration_of, values_of, with_seed
from agents.experiments.trial import Result, Trial
from agents.robots.pioneer import PioneerWorld, load_world
from llrp_online.configuration import RobotConfiguration

_OFFLINE, _ONLINE, _PAPER = "offline", "online, one pass", "offline, the paper's network and loss"
#: Fewest labels the paper knows of a cell -> mean AUC to reach over such cells.
_MEANS = {1000: 0.70, 5000: 0.82}
#: Straight ahead, or behind [m] -> AUC to reach.
_AHEAD = {0.5: 0.98, 1.5: 0.96, 2.0: 0.90, 3.0: 0.81, -1.0: 0.94}


@dataclass(frozen=True)
class Size:
    """How much is run.

    Attributes:
        maps: by seed; one half is learned from and the other tested, and then the other way round.
        seeds: of weights and batches, each over the same maps.
        minutes: of driving on each map.
        steps: of training offline.
        paper_steps: of the paper's network and loss, which at its learning rate takes longer.
    """

    maps: Sequence[int]
    seeds: Sequence[int]
    minutes: float
    steps: int
    paper_steps: int


FULL = Size(tuple(range(10)), (0, 1), 7.0, 1_000, 6_000)
QUICK = Size((0, 1), (0,), 0.5, 30, 30)


def trials(size: Size) -> list[Trial]:
    """All of them."""
    return [trial for _, trial in _named(size)]


def _named(size: Size) -> Iterator[tuple[str, Trial]]:
    """Form and trial."""
    robot, told = configuration_of("pioneer"), world().model_dump(mode="json")
    paper = changed(
        robot,
        {
            "network.preset": "paper",
            "training.loss": "paper",
            "training.learning_rate": 2e-4,
            "training.positive_weight_max": 1.0,
        },
    )
    # The drive is told by what the robot is, not by how it learns, so that all forms share it.
    drives = [PioneerDrive(values_of(robot), told, seed, size.minutes).as_json() for seed in size.maps]
    half = len(drives) // 2
    for seed in size.seeds:
        for learned, tested in ((drives[:half], drives[half:]), (drives[half:], drives[:half])):
            yield _OFFLINE, _trial("offline", with_seed(robot, seed), learned, tested, {"steps": size.steps})
            yield _ONLINE, _trial("online", with_seed(robot, seed), learned, tested, {})
            if seed == size.seeds[0]:
                asked = {"steps": size.paper_steps}
                yield _PAPER, _trial("offline", with_seed(paper, seed), learned, tested, asked)


def _trial(
    work: str,
    form: RobotConfiguration,
    learned: Sequence[Mapping[str, object]],
    tested: Sequence[Mapping[str, object]],
    asked: Mapping[str, int],
) -> Trial:
    told = {"configuration": values_of(form), "learned": list(learned), "tested": list(tested), **asked}
    return Trial(f"agents.experiments.pioneer_learning:{work}", told)


def world() -> PioneerWorld:
    """The world of `configs/`."""
    return load_world(CONFIGS / "worlds" / "pioneer.toml")


def findings(size: Size, results: Sequence[Result]) -> Findings:
    """Every cell beside the paper's, and the means that count."""
    grouped: dict[str, list[Result]] = {}
    for (form, _), result in zip(_named(size), results, strict=True):
        grouped.setdefault(form, []).append(result)
    robot, paper = configuration_of("pioneer"), published()
    targets = robot.targets.build().poses
    cells = {
        form: Cells.of(targets, found, len(size.seeds) if form != _PAPER else 1) for form, found in grouped.items()
    }
    offline, online = cells[_OFFLINE], cells[_ONLINE]
    height, width, _ = robot.picture_shape
    minutes = size.minutes * len(size.maps)
    names = (f"here, {minutes:g} minutes", "the paper, 70 minutes")
    return Findings(
        "pioneer: the paper's second robot",
        _story(size, offline),
        [claim for form, found in cells.items() for claim in _claims(form, found, paper)],
        {"source": paper.source, "cells": {form: found.as_json(paper) for form, found in cells.items()}},
        [
            Plot(
                "rig",
                rig(world(), targets, height, width, size.maps[0]),
                "A map, the floor that the cameras cover, and what they see",
                "Of the floor covered, what the robot's own top (grey) hides is not seen.",
            ),
            Plot(
                "known_labels",
                figures.label_maps(offline.known, paper.known_labels, targets, names),
                "Known labels of each target, here and in the paper",
            ),
            Plot(
                "auc_offline",
                figures.auc_maps(offline.auc, paper.auc, targets, (f"here, {_OFFLINE}", "the paper")),
                "AUC of each target, learned offline, here and in the paper",
            ),
            Plot(
                "auc_online",
                figures.auc_maps(online.auc, paper.auc, targets, (f"here, {_ONLINE}", "the paper")),
                "AUC of each target, learned online in one pass, here and in the paper",
            ),
        ],
        [*_compared(cells), *_REMARKS],
        [_auc_table(form, cells[form], paper) for form in (_OFFLINE, _ONLINE)] + [_label_table(offline, paper)],
    )


def _compared(cells: Mapping[str, Cells]) -> Iterator[str]:
    """What is owed to the world, and what to the learner."""
    fewest, paper = min(_MEANS), published()
    theirs, _, _ = cells[_PAPER].mean(paper.cells(fewest))
    ours, _, _ = cells[_OFFLINE].mean(paper.cells(fewest))
    if theirs is not None and ours is not None:
        yield (
            f"Over the cells of at least {fewest:,} labels the paper's network and loss reach {theirs:.3f} here, ours "
            f"{ours:.3f}. So what lies between this and the paper's {paper.auc[paper.cells(fewest)].mean():.3f} is "
            f"{theirs - paper.auc[paper.cells(fewest)].mean():+.3f} by the world (its noise and cameras, as below) and "
            f"{ours - theirs:+.3f} by the learner."
        )


#: What is not the paper's own, and so bears on the comparison.
_REMARKS = (
    "The paper gives neither the frequency of its noise nor where its cameras stand. Ours is as low as it takes for "
    "the target one metre behind the robot, which no camera sees, to come out as in the paper (lattices of 5, 7 and "
    "8 m were tried). So what lies behind is no fair contest; what is seen ahead depends little on it.",
    "The cameras see the edge of the robot's own grey top: pictures are standardised one by one, and without it a "
    "floor that is all white would look like one that is all black.",
    "The paper's authors stop training early by their test maps. Here the number of steps is fixed beforehand.",
)


def _story(size: Size, offline: Cells) -> str:
    half = len(size.maps) // 2
    return (
        f"{len(size.maps)} maps of 50 x 50 m, {size.minutes:g} minutes at 0.5 m/s on each, 20 samples a second. The "
        f"network learns from one half of the maps ({half}) and predicts the other, then the other way round, for each "
        f"of {len(size.seeds)} seeds of weights and batches (the paper's network and loss: one). AUCs are means over "
        "these; intervals are of 100 rounds that draw whole "
        f"trajectories of the maps tested ({offline.trajectories} in all), as neighbouring frames see the same floor. "
        f"Offline: {size.steps:,} steps of batches of 64. Online: the learner as configured lives through its maps "
        "once, event by event. The cells that the means go over are those of which the paper knows so many labels."
    )


def _claims(form: str, cells: Cells, paper: Published) -> Iterator[Claim]:
    asked = form != _PAPER
    for fewest, bar in _MEANS.items():
        chosen = paper.cells(fewest)
        value, interval, count = cells.mean(chosen)
        theirs = f"the paper's: {paper.auc[chosen].mean():.3f}"
        what = f"{form}: mean AUC, cells of at least {fewest:,} labels ({theirs})"
        yield Claim(what, value, bar if asked else None, interval, f"{count} cells, {cells.runs}")
    for x_m, bar in _AHEAD.items():
        one = cells.at(x_m, 0.0)
        value, interval, _ = cells.mean(one)
        where = f"{x_m:g} m ahead" if x_m > 0 else f"{-x_m:g} m behind"
        what = f"{form}: AUC {where} (the paper's: {paper.auc[one].item():g})"
        n = f"{cells.n_pos[one].item():,} dark, {cells.n_neg[one].item():,} bright, {cells.runs}"
        yield Claim(what, value, bar if asked else None, interval, n)


def _auc_table(form: str, cells: Cells, paper: Published) -> Table:
    caption = (
        "Ours / the paper's, in hundredths. Rows: metres ahead of the robot; columns: metres to its left. "
        "A dash where one class is known, or none; below a hundred labels either is little more than noise."
    )

    def told(auc: float) -> str:
        return "-" if np.isnan(auc) else f"{100 * auc:.0f}"

    pairs = [f"{told(a)}/{told(b)}" for a, b in zip(cells.auc, paper.auc, strict=True)]
    return _grid(f"AUC of every cell, {form}", caption, cells, pairs)


def _label_table(cells: Cells, paper: Published) -> Table:
    caption = "Ours / the paper's, over all maps. Rows and columns as above."
    pairs = [
        f"{figures.in_thousands(a)}/{figures.in_thousands(b)}"
        for a, b in zip(cells.known.tolist(), paper.known_labels.tolist(), strict=True)
    ]
    return _grid("Known labels of every cell", caption, cells, pairs)


def _grid(title: str, caption: str, cells: Cells, texts: Sequence[str]) -> Table:
    """Far ahead at the top, left on the left: as the paper draws it."""
    x_m, y_m = (np.unique(cells.targets[:, axis]) for axis in (0, 1))
    lines = np.array(texts, object).reshape(len(x_m), len(y_m))[::-1, ::-1].tolist()
    rows = [[f"{x:g}", *line] for x, line in zip(x_m[::-1], lines, strict=True)]
    return Table(title, caption, ["x \\ y", *(f"{y:g}" for y in y_m[::-1])], rows)
