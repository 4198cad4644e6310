"""TOML to a frozen value, or an error that says which file, which key, what was got, what is allowed."""

import difflib
import json
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

M = TypeVar("M", bound=BaseModel)


class ConfigurationError(ValueError):
    """A configuration that cannot be used; the message names file, key, what was got and what is allowed."""


def load_toml(path: str | Path, model: type[M]) -> M:
    """Read a TOML file into `model`; ConfigurationError names every fault in it."""
    path = Path(path)
    try:
        raw = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigurationError(f"{path}: cannot be read: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigurationError(f"{path}: not valid TOML: {error}") from error
    return validate(raw, model, str(path))


def validate(raw: Mapping[str, Any], model: type[M], source: str) -> M:
    """A mapping into `model`; `source` names it in the error."""
    try:
        # Strict, since a text is no number; as JSON, since only there a strict model takes a list for a tuple.
        return model.model_validate_json(json.dumps(raw, default=str), strict=True)
    except ValidationError as error:
        faults = [f"  {_explain(fault, model)}" for fault in error.errors()]
        raise ConfigurationError("\n".join([f"{source}: cannot be used", *faults])) from None


def _explain(fault: ErrorDetails, model: type[BaseModel]) -> str:
    # A discriminated union puts its tag into the path ("targets.line.step"), which is no key of the file.
    location = [part for part in fault["loc"] if part not in {"line", "grid", "list"}]
    key = _dotted(location)
    if fault["type"] == "extra_forbidden":
        allowed = sorted(set(_keys(model, location[:-1])))
        near = difflib.get_close_matches(str(location[-1]), allowed, 1, 0.5)
        hint = f"did you mean `{near[0]}`? " if near else ""
        return f"{key}: unknown key (its value: {fault['input']!r}); {hint}allowed: {', '.join(allowed)}"
    if fault["type"] == "missing":
        return f"{key}: missing; it has no default"
    if fault["type"] == "union_tag_not_found":
        return f"{key}.kind: missing; allowed: 'line', 'grid', 'list'"
    message = fault["msg"].removeprefix("Value error, ")
    got = f"got {fault['input']!r}; " if not isinstance(fault["input"], dict | list) else ""
    return f"{key}: {got}{message}" if key else message


def _dotted(location: list[int | str]) -> str:
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location).lstrip(".")


def _keys(model: type[BaseModel], location: list[int | str]) -> Iterator[str]:
    """The keys allowed at `location`, of every model that can stand there."""
    models = [model]
    for part in location:
        if isinstance(part, str):
            fields = [m.model_fields[part].annotation for m in models if part in m.model_fields]
            models = [found for annotation in fields for found in _models_in(annotation)]
    for found in models:
        yield from found.model_fields


def _models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in get_args(annotation):
        yield from _models_in(argument)
