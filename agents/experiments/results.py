"""docs/RESULTS.md: one part a study, each written anew by its command and by nothing else."""

import re
from pathlib import Path

from agents.experiments.findings import Findings, section
from llrp_online.files import replace

_HEAD = """# Results

Written by `llrp experiment NAME --results docs/RESULTS.md`, a part a study; nothing here is typed by hand.
"""


def put(page: Path, study: str, findings: Findings, cost: str) -> None:
    """Write the study's part of the page, `cost` in it: what it took; the others stay as they are."""
    text = page.read_text(encoding="utf-8") if page.exists() else _HEAD
    begin, end = f"<!-- {study} -->\n", f"<!-- end of {study} -->\n"
    part = f"{begin}{section(findings, f'llrp experiment {study} --results docs/RESULTS.md', cost)}{end}"
    old = re.compile(re.escape(begin) + ".*?" + re.escape(end), re.DOTALL)
    replace(page, old.sub(lambda _: part, text) if old.search(text) else f"{text}\n{part}")
