"""What a study found: claims with intervals, tables and figures; and how they are written down."""

import html
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from agents.experiments.statistics import median
from llrp_online import figures, page
from llrp_online.files import replace
from llrp_online.report import versions


@dataclass(frozen=True)
class Claim:
    """One figure that the project stands by, or falls short of.

    Attributes:
        what: is measured.
        value: as measured; None: undefined.
        bar: to reach; None: nothing was asked for.
        interval: 95 %, (low, high); None where there is none.
        n: how many values it is of, in words: "9 runs: 3 scenarios x 3 seeds".
        at_most: the bar is a ceiling, not a floor.
    """

    what: str
    value: float | None
    bar: float | None
    interval: tuple[float, float] | None
    n: str
    at_most: bool = False

    @classmethod
    def median(
        cls,
        what: str,
        values: Sequence[float | None] | NDArray[np.float64],
        n: str,
        bar: float | None = None,
        *,
        at_most: bool = False,
        groups: Sequence[object] | None = None,
    ) -> Self:
        """The median over runs with its interval; runs in which it is undefined (None or NaN) do not count.

        Args:
            what: is measured.
            values: one a run.
            n: how many values it is of; `{}` in it stands for those that count.
            bar: to reach.
            at_most: the bar is a ceiling.
            groups: of runs that are drawn together, one a run; see `statistics.median`.

        >>> Claim.median("AUC", [0.8, None, 0.9], "{} runs").row()
        ['AUC', '0.850', '0.800 to 0.900', '', '', '2 runs']
        """
        found = np.array(values, np.float64)
        there = ~np.isnan(found)
        some = None if groups is None else [group for group, known in zip(groups, there, strict=True) if known]
        middle, interval = median(found[there], some) if there.any() else (None, None)
        return cls(what, middle, bar, interval, n.format(int(there.sum())), at_most)

    @property
    def holds(self) -> bool | None:
        """Is the bar reached? None without a bar or a value."""
        if self.bar is None or self.value is None:
            return None
        return self.value <= self.bar if self.at_most else self.value >= self.bar

    def row(self) -> list[str]:
        """What, value, interval, bar, verdict, n: as they are to be read."""
        low_high = "" if self.interval is None else f"{self.interval[0]:.3f} to {self.interval[1]:.3f}"
        bar = "" if self.bar is None else f"{'at most' if self.at_most else 'at least'} {self.bar:g}"
        verdict = {None: "", True: "holds", False: "short of it"}[self.holds]
        return [self.what, page.number(self.value), low_high, bar, verdict, self.n]

    def as_json(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "what": self.what,
            "value": self.value,
            "bar": self.bar,
            "interval": None if self.interval is None else list(self.interval),
            "n": self.n,
            "at_most": self.at_most,
            "holds": self.holds,
        }


CLAIM_HEADS = ("claim", "value", "95 % interval", "bar", "", "n")


@dataclass(frozen=True)
class Plot:
    """A figure with its words.

    Attributes:
        name: of its files.
        figure: is drawn.
        alt: what it says, for those who cannot see it.
        caption: below it.
    """

    name: str
    figure: Figure
    alt: str
    caption: str = ""


@dataclass(frozen=True)
class Table:
    """Numbers that are to be read beside each other.

    Attributes:
        title: above it.
        caption: how to read it.
        heads: of its columns.
        rows: of cells, each as long as `heads`; the first cell is the row's head.
    """

    title: str
    caption: str
    heads: Sequence[str]
    rows: Sequence[Sequence[str]]

    def markdown(self) -> str:
        """As docs/RESULTS.md has it."""
        return f"### {self.title}\n\n{self.caption}\n\n{_markdown(self.heads, self.rows)}\n"

    def html(self) -> str:
        """As the page has it."""
        caption = f'<p class="note">{html.escape(self.caption)}</p>\n'
        return page.section(self.title, caption + page.table(self.heads, self.rows))


@dataclass(frozen=True)
class Findings:
    """A study's outcome.

    Attributes:
        title: of the page.
        story: what was done, in a few sentences.
        claims: the figures that count.
        numbers: everything measured, plain JSON values.
        plots: figures.
        remarks: where the outcome differs from what was expected, and why.
        tables: that the page and docs/RESULTS.md hold beside the claims.
    """

    title: str
    story: str
    claims: Sequence[Claim]
    numbers: Mapping[str, Any]
    plots: Sequence[Plot] = ()
    remarks: Sequence[str] = field(default=())
    tables: Sequence[Table] = field(default=())


def write(findings: Findings, folder: Path, seeds: Sequence[int]) -> Path:
    """Write report.json, report.html and each figure as PNG and SVG; the page's path."""
    folder.mkdir(parents=True, exist_ok=True)
    told = {
        "title": findings.title,
        "seeds": list(seeds),
        "versions": versions(),
        "claims": [claim.as_json() for claim in findings.claims],
        "numbers": findings.numbers,
    }
    replace(folder / "report.json", json.dumps(told, indent=1, allow_nan=False))
    for plot in findings.plots:
        replace(folder / f"{plot.name}.png", figures.png(plot.figure))
        replace(folder / f"{plot.name}.svg", _svg(plot.figure))
    replace(folder / "report.html", _page(findings, seeds))
    return folder / "report.html"


def section(findings: Findings, command: str, cost: str, pictures: str = "") -> str:
    """The study's part of docs/RESULTS.md; `cost` says what it took to compute, `pictures` are Markdown, too."""
    claims = _markdown(CLAIM_HEADS, [claim.row() for claim in findings.claims])
    remarks = "\n".join(f"- {remark}" for remark in findings.remarks)
    tables = "\n".join(table.markdown() for table in findings.tables)
    head = f"## {findings.title}\n\n    {command}\n\n{cost}. {findings.story}\n"
    parts = [head, f"{claims}\n", f"{remarks}\n" if remarks else "", pictures, tables]
    return "\n".join(filter(None, parts))


def _markdown(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(f"| {' | '.join(cell.replace('|', '/') for cell in line)} |" for line in lines)


def _page(findings: Findings, seeds: Sequence[int]) -> str:
    body = f"<p>{html.escape(findings.story)}</p>\n"
    body += page.section("Claims", page.table(CLAIM_HEADS, [claim.row() for claim in findings.claims]))
    for plot in findings.plots:
        body += page.section(plot.name.replace("_", " "), page.image(plot.figure, plot.alt, plot.caption))
    body += "".join(table.html() for table in findings.tables)
    if findings.remarks:
        said = "".join(f"<li>{html.escape(remark)}</li>" for remark in findings.remarks)
        body += page.section("Where it differs", f"<ul>{said}</ul>\n")
    origin = [("seeds", ", ".join(map(str, seeds))), *versions().items()]
    return page.document(findings.title, body + page.section("How to repeat it", page.table((), origin)))


def _svg(figure: Figure) -> str:
    buffer = io.StringIO()
    # Ids and dates that change from run to run would make two equal figures differ.
    import matplotlib

    with matplotlib.rc_context({"svg.hashsalt": "llrp"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    return buffer.getvalue()
