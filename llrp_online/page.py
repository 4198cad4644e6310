"""The parts of pages that open anywhere, without a network."""

import base64
import html
import math
from collections.abc import Sequence

from matplotlib.figure import Figure

from llrp_online import figures

_STYLE = """
:root { color-scheme: light dark; --ink: #1a1a1a; --ground: #fff; --faint: #666; --rule: #ddd; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e6e6; --ground: #16181b; --faint: #a0a0a0; --rule: #3a3d42; } }
body { font: 16px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--ground);
  max-width: 62rem; margin: 0 auto; padding: 1.5rem; }
h1 { line-height: 1.2; } h2 { margin-top: 2.5rem; border-bottom: 1px solid var(--rule); }
figure { margin: 1rem 0; } figcaption, .note { color: var(--faint); font-size: .9rem; }
img { max-width: 100%; height: auto; background: #fff; padding: .5rem; box-sizing: border-box; border-radius: .4rem; }
.wide { overflow-x: auto; } pre { font-size: .8rem; }
table { border-collapse: collapse; font-size: .85rem; font-variant-numeric: tabular-nums; }
th, td { padding: .15rem .7rem .15rem 0; text-align: left; border-bottom: 1px solid var(--rule); white-space: nowrap; }
summary { cursor: pointer; }
"""


def document(title: str, body: str) -> str:
    """A whole page.

    >>> document("a < b", "").splitlines()[5]
    '<title>a &lt; b</title>'
    """
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{html.escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n"
        f"<h1>{html.escape(title)}</h1>\n{body}</body>\n</html>\n"
    )


def section(title: str, body: str) -> str:
    """A part with a heading."""
    return f"<section>\n<h2>{html.escape(title)}</h2>\n{body}</section>\n"


def image(figure: Figure, alt: str, note: str = "") -> str:
    """A figure within the page itself, with what it says for those who cannot see it, and a caption."""
    data = base64.b64encode(figures.png(figure)).decode("ascii")
    width_px = round(figure.get_figwidth() * 110)
    caption = f"<figcaption>{html.escape(note)}</figcaption>" if note else ""
    source = f'src="data:image/png;base64,{data}" alt="{html.escape(alt)}" width="{width_px}"'
    return f"<figure><img {source}>{caption}</figure>\n"


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Escaped; without heads, the first of each row is its head."""
    top = "".join(f'<th scope="col">{html.escape(head)}</th>' for head in heads)
    body = ""
    for first, *rest in rows:
        cells = "".join(f"<td>{html.escape(value)}</td>" for value in rest)
        tag = "td" if heads else 'th scope="row"'
        body += f"<tr><{tag}>{html.escape(first)}</{tag[:2]}>{cells}</tr>\n"
    return f'<div class="wide"><table>\n{f"<tr>{top}</tr>" if heads else ""}{body}</table></div>\n'


def number(value: float | None) -> str:
    """To three places.

    >>> number(0.98765), number(None)
    ('0.988', 'undefined')
    """
    return "undefined" if value is None or math.isnan(value) else f"{value:.3f}"
