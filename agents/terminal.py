"""The learner at a glance: a live view in a terminal, or one plain line now and then where there is none.

`LearnerView` is pure: what it shows is a function of what it is given. `Terminal` decides where that goes.
"""

import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray
from rich.box import SIMPLE_HEAD
from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.styled import Styled
from rich.table import Table
from rich.text import Text

from agents.status import PerceiverStatus
from llrp_online.status import LearnerStatus

#: A status older than this is not what the learner does now.
STALE_S = 3.0
_BAR_CELLS = 18
_RATE_S = 10.0
_UNKNOWN = "-"


@dataclass(frozen=True)
class Glance:
    """All that is shown at one moment.

    Attributes:
        status: the learner's newest; None before the first.
        age_s: wall time since it came; None before the first.
        steps_per_s: training steps, by wall time; None while unknown.
        perception: the perceiver's newest; None while unknown.
        agents: name -> is it alive.
    """

    status: LearnerStatus | None
    age_s: float | None = None
    steps_per_s: float | None = None
    perception: PerceiverStatus | None = None
    agents: Mapping[str, bool] | None = None

    @property
    def stale(self) -> bool:
        """The learner has not been heard for too long."""
        return self.status is not None and (self.age_s is None or self.age_s > STALE_S)


class LearnerView:
    """What a glance looks like.

    Args:
        robot: its name.
        targets: (T, 3) float64 target poses, as in the learner's configuration.

    >>> view = LearnerView("thymio", np.array([[0.1, 0, 0]]))
    >>> view.line(Glance(None, agents={"learner": False}))
    'thymio: no status from the learner yet; gone: learner'
    """

    def __init__(self, robot: str, targets: NDArray[np.float64]) -> None:
        self._robot = robot
        self._distance_m = np.hypot(targets[:, 0], targets[:, 1]).round(6)

    def render(self, glance: Glance) -> RenderableType:
        """For a terminal at least 80 columns wide."""
        parts: list[RenderableType] = []
        if glance.stale:
            parts.append(Text(f" STALE: {_heard(glance)} ", style="bold white on red", justify="center"))
        if glance.status is None:
            parts.append(Text("no status from the learner yet", style="yellow"))
        else:
            numbers: list[RenderableType] = [self._numbers(glance.status, glance), self._bands(glance.status)]
            parts += [Styled(part, "dim") for part in numbers] if glance.stale else numbers
        parts.append(_agents(glance.agents or {}))
        title = f"{self._robot}: STALE" if glance.stale else self._robot
        return Panel(Group(*parts), title=title, border_style="red" if glance.stale else "cyan")

    def line(self, glance: Glance) -> str:
        """The same in one line of plain text, for a log."""
        status = glance.status
        gone = [name for name, alive in (glance.agents or {}).items() if not alive]
        end = f"; gone: {', '.join(gone)}" if gone else ""
        if status is None:
            return f"{self._robot}: no status from the learner yet{end}"
        bands = ", ".join(
            f"{band.low_m:.2f}-{band.high_m:.2f} m {_number(band.auc, '.2f')} (n+ {band.n_pos}, n- {band.n_neg})"
            for band in status.bands
        )
        p99 = None if glance.perception is None else glance.perception.p99_ms
        return (
            f"{self._robot}: {f'STALE, {_heard(glance)}; ' if glance.stale else ''}"
            f"{'paused; ' if status.paused else ''}"
            f"{status.robot_s / 60:.1f} min, {status.frames} frames ({status.waiting} waiting, "
            f"{status.labelled} labelled), {sum(status.known)} labels ({sum(status.positives)} positive), "
            f"step {status.steps} ({_number(glance.steps_per_s, '.1f')}/s), loss {_number(status.loss, '.3f')}, "
            f"AUC {bands or _UNKNOWN}, version {_number(status.version, 'd')} "
            f"({_number(status.version_age_s, '.0f')} s old, {status.rejected} rejected), "
            f"p99 {_number(p99, '.1f')} ms, drift {status.drift_events}, drops {sum(status.drops.values())}{end}"
        )

    def _numbers(self, status: LearnerStatus, glance: Glance) -> Table:
        table = Table.grid(padding=(0, 2))
        table.add_column(style="dim")
        table.add_column()
        lived = f"{status.robot_s / 60:.1f} robot minutes"
        table.add_row("time", Text(f"{lived}  PAUSED", style="bold yellow") if status.paused else lived)
        table.add_row(
            "frames",
            f"{status.frames:,} seen, {status.waiting:,} waiting, {status.labelled:,} labelled, "
            f"{status.remembered:,} remembered",
        )
        let_go = f", {status.let_go:.0f} let go" if status.let_go >= 1 else ""
        table.add_row(
            "training",
            f"step {status.steps:,}, {_number(glance.steps_per_s, '.1f')} steps/s{let_go}, "
            f"loss {_number(status.loss, '.4f')}",
        )
        weights = f"version {_number(status.version, 'd')}, {_number(status.version_age_s, '.0f')} s old"
        table.add_row("weights", f"{weights}, {status.rejected} rejected")
        table.add_row("inference", _perception(glance.perception))
        table.add_row("drift", f"{status.drift_events} events")
        dropped = ", ".join(f"{count:,} {what}" for what, count in sorted(status.drops.items()) if count)
        table.add_row("drops", Text(dropped or "none", style="yellow" if dropped else ""))
        return table

    def _bands(self, status: LearnerStatus) -> Table:
        """Known labels in all, and the prequential score of the newest frames, by distance."""
        table = Table(box=SIMPLE_HEAD, padding=(0, 1), pad_edge=False)
        table.add_column("distance, m", no_wrap=True)
        table.add_column("labels, █ positive", min_width=_BAR_CELLS, no_wrap=True)
        for name in ("known", "pos %", "AUC", "n+", "n-"):
            table.add_column(name, justify="right", no_wrap=True)
        inside = [(self._distance_m >= b.low_m - 1e-6) & (self._distance_m <= b.high_m + 1e-6) for b in status.bands]
        known = [int(np.array(status.known)[rows].sum()) for rows in inside]
        positives = [int(np.array(status.positives)[rows].sum()) for rows in inside]
        for band, all_, positive in zip(status.bands, known, positives, strict=True):
            table.add_row(
                f"{band.low_m:.2f} to {band.high_m:.2f}",
                _bar(positive, all_, max(known)),
                f"{all_:,}",
                f"{100 * positive / all_:.1f}" if all_ else "",
                "" if band.auc is None else f"{band.auc:.3f}",
                f"{band.n_pos:,}",
                f"{band.n_neg:,}",
            )
        return table


class Rate:
    """Steps a second over the last ten seconds or so.

    >>> rate = Rate()
    >>> rate.update(100, 5.0), rate.update(150, 10.0)
    (None, 10.0)
    """

    def __init__(self) -> None:
        self._seen: deque[tuple[float, int]] = deque()

    def update(self, steps: int, now_s: float) -> float | None:
        """Steps so far, at a wall time; None until two times are known. A count that falls begins anew."""
        if self._seen and steps < self._seen[-1][1]:
            self._seen.clear()
        self._seen.append((now_s, steps))
        while len(self._seen) > 2 and now_s - self._seen[1][0] >= _RATE_S:
            self._seen.popleft()
        first_s, first = self._seen[0]
        return (steps - first) / (now_s - first_s) if now_s > first_s else None


class Terminal:
    """Shows glances: a live view on a terminal, else a line every so often. To be used with `with`.

    Args:
        view: what a glance looks like.
        console: where; left out, standard output.
        every_s: wall time between two lines where there is no terminal.
        clock: wall time [s].
    """

    def __init__(
        self,
        view: LearnerView,
        console: Console | None = None,
        every_s: float = 10.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._view, self._console, self._every_s, self._clock = view, console or Console(), every_s, clock
        self._live: Live | None = None
        self._last_s: float | None = None

    def __enter__(self) -> Self:
        if self._console.is_terminal:
            self._live = Live(console=self._console, auto_refresh=False)
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._live is not None:
            self._live.stop()
            self._live = None

    def show(self, glance: Glance) -> None:
        """Show this now, or, without a terminal, if it is time."""
        if self._live is not None:
            self._live.update(self._view.render(glance), refresh=True)
            return
        now_s = self._clock()
        if self._last_s is None or now_s - self._last_s >= self._every_s:
            self._last_s = now_s
            self._console.print(self._view.line(glance), soft_wrap=True, markup=False, highlight=False)


def _bar(positive: int, known: int, most: int) -> Text:
    """As long as `known` is of `most`; its full part is the positives, drawn as soon as there is one."""
    length = max(round(_BAR_CELLS * known / most), 1) if known else 0
    full = min(max(round(length * positive / known), 1), length) if positive else 0
    return Text.assemble(("█" * full, "red"), ("░" * (length - full), "blue"))


def _perception(perception: PerceiverStatus | None) -> str:
    if perception is None:
        return _UNKNOWN
    return (
        f"{perception.frames_per_s:.1f} frames/s, p50 {perception.p50_ms:.1f} ms, p99 {perception.p99_ms:.1f} ms, "
        f"version {_number(perception.version, 'd')}"
    )


def _agents(agents: Mapping[str, bool]) -> Text:
    """Who is alive, said in words too."""
    text = Text("agents  ", style="dim")
    for name, alive in agents.items():
        text.append(f"{name} {'up' if alive else 'GONE'}  ", style="not dim green" if alive else "not dim bold red")
    return text if agents else Text("agents  none seen", style="dim")


def _heard(glance: Glance) -> str:
    return "never heard" if glance.age_s is None else f"last heard {glance.age_s:.0f} s ago"


def _number(value: float | None, form: str) -> str:
    return _UNKNOWN if value is None else format(value, form)
