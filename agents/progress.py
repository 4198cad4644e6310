"""Progress bars, on standard error, so that standard output stays what was asked for."""

from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

T = TypeVar("T")
#: Told how much of a recording is over, 0 to 1.
Share = Callable[[float], None]
ERRORS = Console(stderr=True)
#: A bar is drawn anew for no less than this: to say it of every message would cost more than to read it.
_STEP = 0.005


def nobody(_share: float) -> None:
    """Where no bar is wanted."""


@contextmanager
def bar() -> Generator[Progress]:
    """A place for progress bars, gone when done; nothing at all where nobody watches."""
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), MofNCompleteColumn())
    times = TimeElapsedColumn(), TimeRemainingColumn()
    unseen = not ERRORS.is_terminal
    with Progress(*columns, *times, console=ERRORS, transient=True, disable=unseen) as progress:
        yield progress


def track(items: Iterable[T], what: str, total: int) -> Iterator[T]:
    """The items, with a bar."""
    with bar() as progress:
        task = progress.add_task(what, total=total)
        for item in items:
            yield item
            progress.advance(task)


def track_recordings(paths: Sequence[Path], what: str) -> Iterator[tuple[Path, Share]]:
    """The files, each with what is to be told how much of it is over; one bar for all."""
    with bar() as progress:
        task = progress.add_task(what, total=len(paths))
        for done, path in enumerate(paths):
            yield path, _teller(progress, task, done)
            progress.update(task, completed=done + 1)


@contextmanager
def share_of(what: str) -> Generator[Share]:
    """A bar for one recording: what is to be told how much of it is over."""
    with bar() as progress:
        yield _teller(progress, progress.add_task(what, total=1), 0)


@contextmanager
def counter(what: str) -> Generator[Callable[[int], None]]:
    """For work without an end of its own: what it is given is the count that is shown."""
    with bar() as progress:
        task = progress.add_task(what, total=None)
        yield lambda count: progress.update(task, completed=count)


def _teller(progress: Progress, task: TaskID, done: int) -> Share:
    shown = 0.0

    def tell(share: float) -> None:
        nonlocal shown
        if share >= shown + _STEP:
            shown = share
            progress.update(task, completed=done + share)

    return tell
