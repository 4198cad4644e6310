"""The documentation: generated pages are up to date, links lead somewhere, and every command shown is one."""

import argparse
import ast
import importlib.util
import re
import shlex
import subprocess
import tomllib
from pathlib import Path

import pytest

from agents import cli
from agents.checks import checker
from llrp_online.configuration import RobotConfiguration, validate

ROOT = Path(__file__).parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def blocks(page, language):
    return [body for found, body in FENCE.findall(page.read_text(encoding="utf-8")) if found == language]


def command_lines(program):
    """Every call of a program in a bash block, continued lines joined."""
    return list(_calls(program))


def _calls(program):
    for page in PAGES:
        for block in blocks(page, "bash"):
            for line in block.replace("\\\n", " ").splitlines():
                if line.split()[:1] == [program]:
                    yield pytest.param(line, id=f"{page.name}: {' '.join(line.split())}")


def headings(page):
    """Anchors as GitHub makes them."""
    text = FENCE.sub("", page.read_text(encoding="utf-8"))
    titles = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.fixture(scope="module")
def generate():
    spec = importlib.util.spec_from_file_location("generate_docs", ROOT / "docs" / "generate.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_pages_are_found():
    names = {page.name for page in PAGES}
    assert {"README.md", "CONTRIBUTING.md", "CHANGELOG.md", "how-it-works.md", "your-robot.md"} <= names
    assert len(command_lines("llrp")) > 30


@pytest.mark.parametrize("name", ["configuration", "commands"])
def test_generated_pages_are_up_to_date(generate, name):
    file = ROOT / "docs" / f"{name}.md"
    assert file.read_text(encoding="utf-8") == getattr(generate, name)(), "run: python docs/generate.py"


def test_a_default_without_a_reason_is_an_error(generate):
    with pytest.raises(ValueError, match=r"\[robot\] camera_sync_s has the default 0.05"):
        list(generate._tables(RobotConfiguration, {}))


def test_a_reason_without_a_key_is_an_error(generate):
    reasons = tomllib.loads((ROOT / "docs" / "reasons.toml").read_text(encoding="utf-8"))["robot_toml"]
    reasons["labels"]["windwo_s"] = "misspelt"
    with pytest.raises(ValueError, match="windwo_s"):
        list(generate._tables(RobotConfiguration, reasons))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    dead = []
    for target, anchor in re.findall(r"\]\(([^)#\s]*)(?:#([^)\s]*))?\)", FENCE.sub("", page.read_text("utf-8"))):
        if re.match(r"[a-z]+:", target):
            continue
        file = (page.parent / target).resolve() if target else page
        if not file.exists() or (anchor and anchor not in headings(file)):
            dead.append(f"{target}#{anchor}")
    assert not dead


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_lines_are_at_most_120_long(page):
    lines = enumerate(page.read_text(encoding="utf-8").splitlines(), 1)
    written = page.name not in ("BENCHMARKS.md", "RESULTS.md")  # a command writes them
    long = [n for n, line in lines if len(line) > 120 and written]
    assert not long


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_named_in_prose_are_commands_with_these_options(page, generate):
    unknown = []
    for words in re.findall(r"(?<!`)`llrp ([^`]*)`(?!`)", FENCE.sub("", page.read_text(encoding="utf-8"))):
        command, *rest = words.split()
        if command not in cli.COMMANDS:
            unknown += [] if command.startswith("-") else [f"llrp {words}"]
            continue
        options = {o for a in generate.command_parser(command)._actions for o in a.option_strings}
        unknown += [f"llrp {words}" for word in rest if word.startswith("--") and word not in options]
    assert not unknown


def test_every_page_is_in_the_navigation_of_the_site():
    def pages(entries):
        for entry in entries:
            [value] = entry.values()
            yield from [value] if isinstance(value, str) else pages(value)

    site = tomllib.loads((ROOT / "zensical.toml").read_text(encoding="utf-8"))["project"]
    there = {str(page.relative_to(ROOT / "docs")) for page in PAGES if page.is_relative_to(ROOT / "docs")}
    assert set(pages(site["nav"])) == there, "put the page into nav of zensical.toml"


def test_troubleshooting_has_every_likely_cause_that_check_names():
    """The causes are the texts that are handed to a finding behind what was seen."""
    page = " ".join((ROOT / "docs" / "troubleshooting.md").read_text(encoding="utf-8").split())
    causes = {cause for cause, _ in checker._DROPS.values()}
    for file in (ROOT / "agents" / "checks").glob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call):
                place = {"Finding": 3, "self._finding": 2}.get(ast.unparse(node.func))
                given = [] if place is None else node.args[place : place + 1]
            elif isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "cause":
                given = [node.value]
            else:
                continue
            causes |= {c.value for g in given for c in ast.walk(g) if isinstance(c, ast.Constant)}
    causes = {cause for cause in causes if isinstance(cause, str) and " " in cause}
    assert len(causes) > 30
    assert sorted(cause for cause in causes if cause not in page) == []


@pytest.mark.parametrize("line", command_lines("llrp"))
def test_every_llrp_command_parses(line, capsys):
    words = shlex.split(re.split(r"\s[>|]", line)[0], comments=True)[1:]
    command = next((word for word in words if word in cli.COMMANDS), None)
    try:
        parsed = cli._parser(command).parse_args(words)
    except SystemExit as end:
        if end.code:
            pytest.fail(capsys.readouterr().err)
        parsed = argparse.Namespace()
    shown = [Path(word) for word in words if word.startswith("configs/") and word != "configs/C.toml"]
    shown += [parsed.scenario] if getattr(parsed, "scenario", None) else []
    assert [path for path in shown if not (ROOT / path).exists()] == []


@pytest.mark.parametrize("line", command_lines("make"))
def test_every_make_target_exists(line):
    words = shlex.split(line, comments=True)
    listed = subprocess.run(["make", "-n", "-C", ROOT, *words[1:]], capture_output=True, text=True, check=False)
    assert listed.returncode == 0, listed.stderr


def test_the_robot_of_the_readme_is_a_whole_one():
    [text] = blocks(ROOT / "README.md", "toml")
    assert validate(tomllib.loads(text), RobotConfiguration, "README.md").robot.name == "rover"


def test_the_robot_built_up_in_your_robot_is_a_whole_one():
    text = "\n".join(blocks(ROOT / "docs" / "your-robot.md", "toml"))
    assert validate(tomllib.loads(text), RobotConfiguration, "your-robot.md").sensors == ["left", "right"]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_python_examples_compile(page):
    for block in blocks(page, "python"):
        compile(block, str(page), "exec")


def test_figures_of_the_readme_are_those_of_the_results():
    told = (ROOT / "README.md").read_text(encoding="utf-8").partition("## What it reaches")[2].partition("\n## ")[0]
    found = re.findall(r"\b[01]\.\d{3}\b", told)
    results = (ROOT / "docs" / "RESULTS.md").read_text(encoding="utf-8")
    assert len(found) > 10
    assert not [figure for figure in found if not re.search(rf"\b{re.escape(figure)}\b", results)]
