"""`llrp window`: how long a robot may trust its odometry, from its own recordings, in one picture and one sentence."""

import argparse
import html
import json
import math
from pathlib import Path

from agents.commands import options
from agents.drive_arrays import drive_of
from agents.progress import track, track_recordings
from agents.window_answer import Answer, compare, learner_of
from llrp_online import figures, page
from llrp_online.configuration import RobotConfiguration
from llrp_online.files import replace

_HEADS = ("window", "known a frame", "positive a frame", "agreeing", "bits felt twice", "worth a frame")
_NOTE = (
    "Known labels a frame, and how much of what was felt twice at a place, at most a window apart, agrees. "
    "Grey: the recommended window. Open marks and dotted lines: drift."
)


def configure(parser: argparse.ArgumentParser) -> None:
    """Its words."""
    options.add_recordings(parser)
    options.add_config(parser)
    options.add_json(parser)
    parser.add_argument(
        "--output", type=Path, default=Path("runs/window.html"), help="the page (default: runs/window.html)"
    )
    parser.add_argument(
        "--learn", action="store_true", help="also the prequential AUC of a learner of each window; a minute each"
    )
    parser.epilog = (
        "Agreement is measured without knowing the truth: where the robot comes back to a place, by its odometry, does "
        "it feel\nthe same? Worth is the number of faultless labels that those known are as good as. A prequential AUC "
        "is by the labels\nof its own window, so it flatters a window whose labels are wrong in a way that can be "
        "learned.\n\nexample:\n  llrp window WALK.mcap --config configs/nao.toml"
    )


def run(arguments: argparse.Namespace) -> int:
    """Compare, write the page, print."""
    configuration = options.load_configuration(arguments)
    options.make_room(arguments.output)
    answer = compare(
        configuration,
        [drive_of(configuration, path, told) for path, told in track_recordings(arguments.recordings, "reading")],
    )
    if arguments.learn:
        names = [row.window for row in answer.rows]
        answer = answer.scored(
            {name: _learned(configuration, name, arguments.recordings) for name in track(names, "learning", len(names))}
        )
    replace(arguments.output, _page(configuration, answer, arguments.recordings))
    if arguments.json:
        print(json.dumps(answer.as_json(), allow_nan=False))
    else:
        for row in _table(answer, learned=arguments.learn):
            print("  ".join(f"{cell:>16}" for cell in row))
        print(f"{answer.sentence()}\nsee {arguments.output}")
    return 0


def _learned(configuration: RobotConfiguration, window: str, recordings: list[Path]) -> float | None:
    """Prequential AUC of all labels together; None where it is undefined."""
    from agents.replayed import learn_over
    from llrp_online.learner import Learner

    learner = Learner(learner_of(configuration, window))
    learn_over(learner, recordings)
    auc = learner.prequential.score().pooled_auc
    return None if math.isnan(auc) else auc


def _table(answer: Answer, *, learned: bool) -> list[list[str]]:
    """Heads, then a row a window."""
    rows: list[list[str]] = [[*_HEADS, *(["prequential AUC"] if learned else [])]]
    for row in answer.rows:
        share = "" if row.agreeing is None else f"{100 * row.agreeing:.1f} %"
        worth = "" if row.worth is None else f"{row.worth:.2f}"
        cells = [row.window, f"{row.known:.2f}", f"{row.positive:.2f}", share, f"{row.felt_twice:,}", worth]
        rows.append([*cells, page.number(row.prequential_auc)] if learned else cells)
    return rows


def _page(configuration: RobotConfiguration, answer: Answer, recordings: list[Path]) -> str:
    title = f"{configuration.robot.name}: how long to trust odometry"
    what = f"{answer.frames:,} frames of {len(recordings)} recording{'s' if len(recordings) > 1 else ''}"
    drawn = figures.windows([answer.panel(what)], "agreeing when felt twice")
    heads, *rows = _table(answer, learned=any(row.prequential_auc is not None for row in answer.rows))
    body = f"<p>{html.escape(answer.sentence())}</p>\n"
    body += page.image(drawn, "Known labels a frame and agreement of places felt twice, by window", _NOTE)
    body += page.table(heads, rows)
    return page.document(
        title, body + page.section("Recordings", page.table((), [[path.name, ""] for path in recordings]))
    )
