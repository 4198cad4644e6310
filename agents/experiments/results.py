"""docs/RESULTS.md: one part a study with its pictures, each written anew by its command and by nothing else."""

import re
from collections.abc import Iterator
from pathlib import Path

from agents.experiments.findings import Findings, section
from llrp_online import figures
from llrp_online.files import replace

#: Where the pictures lie, from where the page does.
_PICTURES = Path("pictures", "results")

_HEAD = """# Results

Written by `llrp experiment NAME --results docs/RESULTS.md`, a part a study; nothing here is typed by hand.
"""


def put(page: Path, study: str, findings: Findings, cost: str) -> None:
    """Write the study's part of the page, `cost` in it: what it took; the others stay as they are."""
    text = page.read_text(encoding="utf-8") if page.exists() else _HEAD
    begin, end = f"<!-- {study} -->\n", f"<!-- end of {study} -->\n"
    pictures = "\n".join(_pictures(page.parent, study, findings))
    part = section(findings, f"llrp experiment {study} --results docs/RESULTS.md", cost, pictures)
    old = re.compile(re.escape(begin) + ".*?" + re.escape(end), re.DOTALL)
    whole = f"{begin}{part}{end}"
    replace(page, old.sub(lambda _: whole, text) if old.search(text) else f"{text}\n{whole}")


def _pictures(beside: Path, study: str, findings: Findings) -> Iterator[str]:
    """Write the study's figures, and take away those it no longer has; Markdown that shows them."""
    folder = beside / _PICTURES
    folder.mkdir(parents=True, exist_ok=True)
    files = {plot.name: folder / f"{study}-{plot.name}.png" for plot in findings.plots}
    for file in set(folder.glob(f"{study}-*.png")) - set(files.values()):
        file.unlink()
    for plot in findings.plots:
        replace(files[plot.name], figures.png(plot.figure))
        yield f"![{plot.alt}]({(_PICTURES / files[plot.name].name).as_posix()})\n"
        yield f"*{plot.caption or plot.alt}*\n"
