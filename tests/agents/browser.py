"""A headless browser for the tests of the dashboard, or the reason why there is none; and a page in it, looked at."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.agents.processes import WAIT_S, until

_NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")

#: Of a canvas: where it has a colour of the page [pixels], and its size.
_PIXELS = """
([selector, name]) => {
  const canvas = document.querySelector(selector), { width, height } = canvas;
  const text = getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  const wanted = [1, 3, 5].map((n) => parseInt(text.slice(n, n + 2), 16));
  const { data } = canvas.getContext("2d").getImageData(0, 0, width, height), found = [];
  for (let i = 0; i < width * height; i++)
    if (wanted.every((value, c) => Math.abs(data[4 * i + c] - value) < 4))
      found.push([i % width, Math.floor(i / width)]);
  return [found, [width, height]];
}
"""


@contextmanager
def browser() -> Iterator[Any]:
    """The system's Chromium; skips the tests where it, or what drives it, is missing."""
    api = pytest.importorskip("playwright.sync_api", reason="to test pages: pip install playwright")
    path = next(filter(None, map(shutil.which, _NAMES)), None)
    if path is None:
        pytest.skip("to test pages in a browser: apt-get install chromium")
    with api.sync_playwright() as playwright:
        running = playwright.chromium.launch(executable_path=path, args=["--no-sandbox", "--disable-gpu"])
        yield running
        running.close()


class Watcher:
    """Looks at a dashboard's page, and keeps what goes wrong in it.

    Attributes:
        port: the dashboard's.
        page: the one looked at.
        faults: what the page's scripts complained of.
    """

    def __init__(self, chromium: Any, screenshots: Path | None = None) -> None:
        self.chromium, self.screenshots = chromium, screenshots
        self.port = 0
        self.page: Any = None
        self.faults: list[str] = []

    def open(self, **context: Any) -> Any:
        page = self.chromium.new_page(**context)
        page.set_default_timeout(1000 * WAIT_S)
        page.on("pageerror", lambda error: self.faults.append(str(error)))
        page.on("console", lambda said: self.faults.append(said.text) if said.type == "error" else None)
        self.faults = []
        page.goto(f"http://127.0.0.1:{self.port}/")
        page.wait_for_selector("[data-link=live]")
        return page

    def until(self, script: str, what: str) -> None:
        """Wait until a script is true in the page, which itself may not evaluate texts."""
        until(lambda: self.page.evaluate(script), f"{what}; {self.faults}")

    def text(self, selector: str) -> str:
        return self.page.inner_text(selector)

    def picture(self, selector: str) -> str:
        """A canvas or the source of an image, as text that differs when it does."""
        return self.page.eval_on_selector(selector, "e => e.tagName === 'CANVAS' ? e.toDataURL() : e.src")

    def until_it_changes(self, selector: str) -> None:
        before = self.picture(selector)
        until(lambda: self.picture(selector) != before, f"{selector} changes")

    def where(self, canvas: str, colour: str) -> NDArray[np.float64]:
        """(N, 2): pixels of a canvas that have a colour of the page, from the left and from the top, each 0 to 1."""
        found, size = self.page.evaluate(_PIXELS, [canvas, colour])
        return np.array(found, np.float64).reshape(-1, 2) / size

    def shoot(self, name: str, **more: Any) -> None:
        if self.screenshots is not None:
            self.page.wait_for_timeout(700)
            self.page.screenshot(path=str(self.screenshots / f"dashboard-{name}.png"), **more)
