"""For the site's API pages: the examples of docstrings, which the tests run, become blocks of code."""

import re
from typing import Any

import griffe

_EXAMPLE = re.compile(r"^>>> .*(?:\n(?!\s*$).*)*", re.MULTILINE)


class Doctests(griffe.Extension):
    """Fences every example; Markdown would make quotations of them."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Called for each object that is loaded."""
        if obj.docstring is not None:
            obj.docstring.value = fenced(obj.docstring.value)


def fenced(text: str) -> str:
    """A docstring whose examples stand in fences: from `>>>` to the next empty line."""
    return _EXAMPLE.sub(lambda example: f"```pycon\n{example[0]}\n```", text)
