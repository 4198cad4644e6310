"""Writes docs/configuration.md and docs/commands.md from the program itself, so that they cannot disagree with it.

    python docs/generate.py            write both files
    python docs/generate.py --check    exit code 1 if a file is out of date

Keys, types, ranges and defaults come from the pydantic models, options from the command line's own parsers. Why a
default is what it is stands in docs/reasons.toml; a key without a reason, or a reason without a key, is an error.
"""

import argparse
import math
import re
import sys
import textwrap
import tomllib
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from agents import cli
from agents.robots.simulated.scenario import Scenario
from llrp_online.configuration import RobotConfiguration

FOLDER = Path(__file__).parent
_BOUNDS = {"gt": ">", "ge": "≥", "lt": "<", "le": "≤"}
_PLAIN = {str: "text", int: "integer", float: "number", bool: "true or false"}
_UNITS = {
    "_m_s2": "m/s²",
    "_m_per_sqrt_m": "m/√m",
    "_rad_per_sqrt_m": "rad/√m",
    "_rad_per_sqrt_rad": "rad/√rad",
    "_rad_s": "rad/s",
    "_m_s": "m/s",
    "_deg": "deg",
    "_rad": "rad",
    "_hz": "Hz",
    "_mb": "MB",
    "_m": "m",
    "_s": "s",
}
_WIDTH = 118
_WHOLE: dict[str, Any] = {"break_long_words": False, "break_on_hyphens": False}


def configuration() -> str:
    """The page of all keys."""
    reasons = tomllib.loads((FOLDER / "reasons.toml").read_text(encoding="utf-8"))
    parts = [_CONFIGURATION_INTRODUCTION]
    parts += _tables(RobotConfiguration, reasons["robot_toml"])
    parts += [_SCENARIO_INTRODUCTION, *_tables(Scenario, reasons["scenario_toml"])]
    return "\n".join(parts)


def _tables(whole: type[BaseModel], reasons: dict[str, dict[str, str]]) -> Iterator[str]:
    given = {(table, key) for table, keys in reasons.items() for key in keys}
    for name, field in whole.model_fields.items():
        models = list(_models(field.annotation))
        several = get_origin(field.annotation) is list
        title = f"[[{name}]]" if several else f"[{name}]"
        yield f"## `{title}`\n"
        if not field.is_required():
            yield "May be left out.\n"
        for model in models:
            if story := _story(model):
                yield f"{story}\n"
            yield "".join(_key(name, key, of, reasons, given) for key, of in model.model_fields.items())
    if given:
        raise ValueError(f"docs/reasons.toml: reasons for keys that do not exist: {sorted(given)}")


def _story(model: type[BaseModel]) -> str:
    """The model's docstring without the table's name, which the heading says, and without its examples."""
    first = (model.__doc__ or "").strip().split("\n\n")[0].replace("\n    ", " ")
    story = re.sub(r"^\[+\w+\]+[.:]?\s*", "", first)
    return story[:1].upper() + story[1:]


def _key(
    table: str, key: str, field: FieldInfo, reasons: dict[str, dict[str, str]], given: set[tuple[str, str]]
) -> str:
    reason = reasons.get(table, {}).get(key, "")
    given.discard((table, key))
    if not field.is_required() and field.default is not None and not reason:
        raise ValueError(f"docs/reasons.toml: [{table}] {key} has the default {field.default!r}: say why")
    what, unit = field.description or "", _unit(key)
    if found := re.search(r"\s*\[([^\]]+)\]$", what):
        what, unit = what[: found.start()], found.group(1)
    kind = _type(field.annotation) + (f" [{unit}]" if unit else "")
    facts = ", ".join(fact for fact in (kind, _range(field), _default(field)) if fact)
    because = f" Default: {reason}." if reason else ""
    return _item(f"**`{key}`** ({facts})" + (f": {what}." if what else "") + because)


def _item(text: str) -> str:
    """A list item within the width of a page."""
    return textwrap.fill(text, _WIDTH, subsequent_indent="  ", initial_indent="- ", **_WHOLE) + "\n"


def _unit(key: str) -> str:
    return next((unit for ending, unit in _UNITS.items() if key.endswith(ending)), "")


def _type(annotation: Any) -> str:
    origin, arguments = get_origin(annotation), get_args(annotation)
    if annotation in _PLAIN:
        return _PLAIN[annotation]
    if hasattr(annotation, "__metadata__"):  # Annotated
        return _type(arguments[0])
    if origin is Literal:
        return "one of " + ", ".join(f"`{value}`" for value in arguments) if len(arguments) > 1 else f"`{arguments[0]}`"
    if origin in (Union, types.UnionType):
        return _type(next(argument for argument in arguments if argument is not type(None)))
    if origin is tuple and arguments[-1] is not Ellipsis:
        return f"list of {len(arguments)} {_type(arguments[0])}s"
    if origin in (list, tuple):
        inner = _type(arguments[0])
        return f"list of {'lists' if inner.startswith('list') else inner + 's'}"
    raise TypeError(f"no words for the type {annotation!r}")


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "**must be given**"
    value: Any = field.default
    if value is None:
        return "may be left out"
    if isinstance(value, list | tuple):
        shown = "[" + ", ".join(f"{v:g}" for v in value) + "]"
    elif isinstance(value, float):
        shown = f"{value:.4g}"
    else:
        shown = f'"{value}"' if isinstance(value, str) else str(value)
    return f"default `{shown}`"


def _range(field: FieldInfo) -> str:
    found: list[str] = []
    for constraint in field.metadata:
        found += [
            f"{sign} {getattr(constraint, name):g}" for name, sign in _BOUNDS.items() if hasattr(constraint, name)
        ]
        if hasattr(constraint, "min_length"):
            found.append(f"at least {constraint.min_length}")
        if pattern := getattr(constraint, "pattern", None):
            found.append(f"`{pattern}`")
    return ", ".join(found)


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in get_args(annotation):
        yield from _models(argument)


def commands() -> str:
    """The page of all commands."""
    codes = "".join(f"| {code} | {meaning} |\n" for code, meaning in cli.EXIT_CODES.items())
    parts = [_COMMANDS_INTRODUCTION.replace("EXIT_CODES\n", f"{codes}\n")]
    parts[0] += "".join(f"\n| [`llrp {name}`](#llrp-{name}) | {story} |" for name, story in cli.COMMANDS.items())
    for name, story in cli.COMMANDS.items():
        parser = command_parser(name)
        parts.append(f"\n## llrp {name}\n\n{story[:1].upper()}{story[1:]}.\n")
        parts.append("".join(_argument(action) for action in parser._actions if action.dest != "help"))
        if parser.epilog:
            parts.append(_epilog(parser.epilog.removesuffix(f"\n\n{cli.EXIT_CODES_TEXT}")))
    return "\n".join(parts) + "\n"


def command_parser(name: str) -> argparse.ArgumentParser:
    """The parser of one command, with all its options."""
    for action in cli._parser(name)._actions:
        if isinstance(action, argparse._SubParsersAction):
            return action.choices[name]
    raise LookupError(f"llrp has no command {name!r}")


def _argument(action: argparse.Action) -> str:
    value = action.metavar or (action.dest.upper() if action.nargs != 0 else "")
    if action.choices:
        value = "{" + ",".join(str(choice) for choice in action.choices) + "}"
    value = f"{value} ..." if action.nargs in ("+", "*") else str(value)
    name = " ".join([*action.option_strings[-1:], value]).strip()
    default: Any = action.default
    if (action.required and action.option_strings) or (not action.option_strings and action.nargs != "*"):
        shown = "**must be given**"
    elif default is None or default is False or default == []:
        shown = ""
    elif isinstance(default, float):
        shown = "default no end" if math.isinf(default) else f"default `{default:g}`"
    else:
        shown = f"default `{' '.join(map(str, default)) if isinstance(default, list) else default}`"
    what = re.sub(r"\s*\(default:? [^)]*\)", "", action.help or "").strip()
    return _item(f"`{name}`" + (f" ({shown})" if shown else "") + (f": {what}" if what else ""))


def _epilog(text: str) -> str:
    """Prose as it is, names with their stories in a list, command lines in a block, what is said behind as comments."""
    lines: list[str] = []
    fenced = False
    for line in text.splitlines():
        if line.strip() in ("example:", "examples:"):
            continue
        if line.startswith("  ") and not line.startswith("  llrp "):
            name, story = line.split(maxsplit=1)
            lines.append(f"- `{name}`: {story}")
            continue
        if line.startswith("  ") != fenced:
            fenced = not fenced
            lines.append("```bash" if fenced else "```")
        command, *rest = re.split(r"\s{2,}", line.strip()) if fenced else [line]
        remark = " ".join(rest).strip("()")
        lines.append(f"{command}  # {remark}" if remark else command)
    return "\n".join(lines + ["```"] * fenced)


_CONFIGURATION_INTRODUCTION = """\
<!-- Written by docs/generate.py; change the models or docs/reasons.toml instead. -->
# Configuration

A robot is one TOML file, checked as a whole before anything runs. An unknown key or a value out of range is an error
that names the file, the key, what was got and what is allowed. Only `[robot]`, `[[camera]]`, `[[short_range]]`,
`[targets]` and `[labels]` must be there. [Your robot](your-robot.md) takes you through them.

Behind each key: its type, its unit, what it may be, its default; then what it means and why the default is what it is.
A distance, a time or an angle has its unit in its name, too: `window_s` is in seconds.
"""

_SCENARIO_INTRODUCTION = """\
# Scenarios

What a simulated arena is made of: the files in `configs/scenarios/`. A scenario names kinds and sizes; a seed draws one
layout from it.
"""

_COMMANDS_INTRODUCTION = """\
<!-- Written by docs/generate.py; change the commands in agents/commands/ instead. -->
# Commands

One program, `llrp`. Paths of configurations and scenarios are looked for from where you stand: run it in the project's
folder. Progress bars and whatever else is not the answer go to standard error, bars only to a terminal.

## Exit codes

| exit code | meaning |
|---|---|
EXIT_CODES
So a script can go by them: `llrp check` says no when there is an error among its findings, `llrp export` when the file
differs from the network, `llrp play` when the recording lacked a topic. What a command says no to is in its part below.

## All of them

| command | what it does |
|---|---|"""


def main() -> int:
    """Write or compare; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="write nothing, say what is out of date")
    check = parser.parse_args().check
    stale = False
    for name, text in (("configuration.md", configuration()), ("commands.md", commands())):
        file = FOLDER / name
        if check:
            if not file.exists() or file.read_text(encoding="utf-8") != text:
                print(f"{file}: out of date; run: python docs/generate.py", file=sys.stderr)
                stale = True
        else:
            file.write_text(text, encoding="utf-8")
    return int(stale)


if __name__ == "__main__":
    sys.exit(main())
