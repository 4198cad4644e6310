"""Progress bars, on standard error, so that standard output stays what was asked for."""

from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

T = TypeVar("T")
ERRORS = Console(stderr=True)


@contextmanager
def bar() -> Generator[Progress]:
    """A place for progress bars, gone when done; nothing at all where nobody watches."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    unseen = not ERRORS.is_terminal
    with Progress(*columns, TimeRemainingColumn(), console=ERRORS, transient=True, disable=unseen) as progress:
        yield progress


def track(items: Iterable[T], what: str, total: int) -> Iterator[T]:
    """The items, with a bar."""
    with bar() as progress:
        task = progress.add_task(what, total=total)
        for item in items:
            yield item
            progress.advance(task)


def track_files(paths: list[Path], what: str) -> Iterator[Path]:
    """The files, with a bar."""
    yield from track(paths, what, len(paths))
