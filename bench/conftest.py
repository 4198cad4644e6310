"""What the benchmarks share: `--short`; `record`, which takes a row into the report and judges it; and `race`.

pytest-benchmark times, writes the JSON and says what machine it was; the rows stand in that JSON under "rows".
"""

import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Protocol

import pytest

from bench.rows import LOOSELY, Figure, Growth, Row

Work = Callable[[], object]
Measured = Row | Growth
_MEASURED = pytest.StashKey[list[Measured]]()


class Race(Protocol):
    """Time our work beside others' that do the same, in turn; see `race`."""

    def __call__(
        self,
        path: str,
        ours: Work,
        peers: Mapping[str, Work],
        bars: Mapping[str, float],
        *,
        limit: tuple[str, Work] | None = None,
        per: int = 1,
        most_s: float | None = None,
        rounds: int = 10,
        note: str = "",
        gaps: Mapping[str, str] | None = None,
    ) -> Row: ...


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--short", action="store_true", help="small inputs, few rounds, ratios judged loosely")


def pytest_benchmark_update_json(config: pytest.Config, output_json: dict[str, Any]) -> None:
    measured = config.stash.get(_MEASURED, [])
    output_json["rows"] = [row.as_json() for row in measured if isinstance(row, Row)]
    output_json["growth"] = [growth.as_json() for growth in measured if isinstance(growth, Growth)]


@pytest.fixture
def short(request: pytest.FixtureRequest) -> bool:
    """Is this the short form?"""
    return bool(request.config.getoption("--short"))


@pytest.fixture
def record(request: pytest.FixtureRequest, short: bool) -> Iterator[Callable[[Measured], None]]:
    """Take in a row or a growth: it stands in the report whatever it says, and fails the test if a bar is missed."""
    rows: list[Measured] = []
    yield rows.append
    request.config.stash.setdefault(_MEASURED, []).extend(rows)
    failures = [failure for row in rows for failure in row.failures(LOOSELY if short else 1.0)]
    assert rows, "nothing was measured"
    assert not failures, "\n".join(failures)


@pytest.fixture
def race(benchmark: Any, record: Callable[[Measured], None], short: bool) -> Race:
    """Time our work, the peers' and the limit's in turn, round after round, so that a slow moment slows them all.

    Each function does its work once, or `per` times where once is too short to time; `rounds` are halved in the short
    form. `bars` says how many times as much as ours a peer must take, `gaps` where that is known to be missed and why.
    One race a test.
    """

    def run(
        path: str,
        ours: Work,
        peers: Mapping[str, Work],
        bars: Mapping[str, float],
        *,
        limit: tuple[str, Work] | None = None,
        per: int = 1,
        most_s: float | None = None,
        rounds: int = 10,
        note: str = "",
        gaps: Mapping[str, str] | None = None,
    ) -> Row:
        rounds = max(rounds // 2, 3) if short else rounds
        others = dict(peers) if limit is None else {**peers, limit[0]: limit[1]}
        seconds: dict[str, list[float]] = {name: [] for name in others}

        def before_ours() -> None:
            for name, work in others.items():
                start = time.perf_counter()
                work()
                seconds[name].append((time.perf_counter() - start) / per)

        benchmark.pedantic(ours, setup=before_ours, rounds=rounds, warmup_rounds=1, iterations=1)
        figures = {name: Figure(values[1:]) for name, values in seconds.items()}
        row = Row(
            path,
            Figure([value / per for value in benchmark.stats.stats.data]),
            {name: figures[name] for name in peers},
            bars,
            None if limit is None else (limit[0], figures[limit[0]]),
            most_s,
            note=note,
            gaps=gaps or {},
        )
        record(row)
        return row

    return run
