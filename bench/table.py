"""The table of `docs/BENCHMARKS.md`, from the JSON that the benchmarks wrote.

    python bench/table.py runs/bench.json --output docs/BENCHMARKS.md

Prints it too. Nothing in that file is written by hand. Of several reports the later ones' rows take the place of those
of the same name: a part can be measured again, on a machine that has come to rest.
"""

import argparse
import json
from importlib import metadata
from pathlib import Path
from typing import Any

_PACKAGES = (
    "numba",
    "numpy",
    "torch",
    "scipy",
    "opencv-python-headless",
    "onnxruntime",
    "rosbags",
    "mcap",
    "mujoco-core",
    "scikit-learn",
    "kornia",
    "torchrl",
    "cpprb",
)
_SCALES = ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs"))

_HEAD = """\
# Benchmarks

Written by `make bench`; not a word of it by hand. Each path is timed beside its peers in one process, in turn, round
after round: read the ratios, since the times are those of one machine in one hour. A peer's ratio says how many times
as long as ours it takes; the bar is the ratio asked for. A bar below 1 allows ours to take longer: .77 is "at most 1.3
times". The limit is what no program can go below, measured in the same run.

"""


def main() -> None:
    """Read, print, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("reports", type=Path, nargs="+", help="JSON of `pytest bench --benchmark-json`")
    parser.add_argument("--output", type=Path, help="Markdown file to write")
    arguments = parser.parse_args()
    text = page(merged([json.loads(report.read_text()) for report in arguments.reports]))
    print(text)
    if arguments.output:
        arguments.output.write_text(text)


def merged(reports: list[dict[str, Any]]) -> dict[str, Any]:
    """One report: the first, with the rows of the later ones in their place."""
    rows = {row["path"]: row for report in reports for row in report["rows"]}
    growth = {(row["path"], row["quantity"]): row for report in reports for row in report["growth"]}
    return {**reports[0], "rows": list(rows.values()), "growth": list(growth.values())}


def page(report: dict[str, Any]) -> str:
    """The whole page."""
    parts = [_HEAD, _circumstances(report), "\n## Paths\n\n", _paths(report["rows"])]
    if notes := [f"- {row['path']}: {row['note']}" for row in report["rows"] if row["note"]]:
        parts += ["\n", "\n".join(notes), "\n"]
    gaps = [(row["path"], *gap) for row in report["rows"] for gap in row["gaps"].items()]
    if gaps:
        parts += ["\n## Where it falls short, and what stops it\n\n"]
        parts += [f"- {path}, beside {peer}: {why}\n" for path, peer, why in gaps]
    if report["growth"]:
        parts += ["\n## Growth\n\n", _growth(report["growth"])]
    return "".join(parts)


def _circumstances(report: dict[str, Any]) -> str:
    """Machine and versions, without a word of whose machine it is."""
    machine = report["machine_info"]
    cpu = machine.get("cpu", {})
    versions = ", ".join(f"{name} {_version(name)}" for name in _PACKAGES)
    return (
        f"{cpu.get('brand_raw', machine['machine'])}, {cpu.get('count', '?')} cores, {machine['system']}, "
        f"Python {machine['python_version']}; {versions}.\n"
    )


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "(not installed)"


def _paths(rows: list[dict[str, Any]]) -> str:
    lines = [
        "| path | ours (quartiles) | n | beside | takes | ratio | bar | holds |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        unit, ours = row["unit"], row["ours"]
        cells = [
            row["path"],
            f"{_shown(ours['median'], unit)} ({_shown(ours['low'], unit)} to {_shown(ours['high'], unit)})",
        ]
        cells.append(str(ours["n"]))
        beside = [_beside(name, peer, unit) for name, peer in row["peers"].items()]
        if row["limit"] is not None:
            limit = row["limit"]
            ratio = limit["median"] / ours["median"]
            beside.append([f"*limit: {limit['name']}*", _shown(limit["median"], unit), f"{ratio:.2f}", "", ""])
        if row["most"] is not None:
            held = "yes" if ours["median"] <= row["most"] else "**no**"
            beside.append(["*at most*", _shown(row["most"], unit), "", "", held])
        for number, others in enumerate(beside or [["", "", "", "", ""]]):
            lines.append(_line([*(cells if number == 0 else ["", "", ""]), *others]))
    return "\n".join(lines) + "\n"


def _beside(name: str, peer: dict[str, Any], unit: str) -> list[str]:
    ratio, bar = peer["ratio"], peer["bar"]
    held = "" if bar is None else "yes" if ratio >= bar else "**no**"
    return [name, _shown(peer["median"], unit), f"{ratio:.3g}", "" if bar is None else f"{bar:.3g}", held]


def _growth(rows: list[dict[str, Any]]) -> str:
    lines = ["| path | with | cost | exponent | at most | holds |", "|---|---|---|---|---|---|"]
    for row in rows:
        costs = " → ".join(_shown(figure["median"], row["unit"]) for figure in row["figures"])
        sizes = " → ".join(f"{size:,g}" for size in row["sizes"])
        held = "yes" if row["holds"] else "**no**"
        cells = [row["path"], f"{row['quantity']}: {sizes}", costs, f"{row['exponent']:.2f}", f"{row['most']:g}", held]
        lines.append(_line(cells))
    return "\n".join(lines) + "\n"


def _line(cells: list[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _shown(value: float, unit: str) -> str:
    """Three digits, seconds in the scale that suits them."""
    if unit != "s":
        return f"{value:.3g} {unit}".strip()
    scale, name = next(((scale, name) for scale, name in _SCALES if value >= scale), _SCALES[-1])
    return f"{value / scale:.3g} {name}"


if __name__ == "__main__":
    main()
