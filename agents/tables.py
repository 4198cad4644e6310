"""Scores as people read them in a terminal."""

import math

from rich.console import Console
from rich.table import Table

from llrp_online.metrics import Score
from llrp_online.prequential import Band


def print_score(score: Score, title: str) -> None:
    """AUC of every target (row) and sensor (column), with its interval and the counts of both classes."""
    table = Table("x m", "y m", *score.sensors, title=f"AUC [95 % interval] n+/n-: {title}", title_justify="left")
    for target, pose in enumerate(score.targets):
        cells = [_cell(score, target, sensor) for sensor in range(len(score.sensors))]
        table.add_row(f"{pose[0]:.2f}", f"{pose[1]:.2f}", *cells)
    console = Console(width=max(Console().width, 24 + 30 * len(score.sensors)))
    console.print(table)
    pooled = "undefined" if math.isnan(score.pooled_auc) else f"{score.pooled_auc:.3f}"
    console.print(f"all known labels together: AUC {pooled}, n+ {score.n_pos.sum()}, n- {score.n_neg.sum()}")


def print_bands(bands: list[Band]) -> None:
    """The prequential score by distance."""
    table = Table("distance m", "AUC", "n+", "n-", "log-loss", title="prequential, by distance", title_justify="left")
    for band in bands:
        auc, loss = (("" if value is None else f"{value:.3f}") for value in (band.auc, band.log_loss))
        table.add_row(f"{band.low_m:.2f} to {band.high_m:.2f}", auc, str(band.n_pos), str(band.n_neg), loss)
    Console().print(table)


def _cell(score: Score, target: int, sensor: int) -> str:
    auc, low, high = (values[target, sensor] for values in (score.auc, score.low, score.high))
    counts = f"{score.n_pos[target, sensor]}/{score.n_neg[target, sensor]}"
    if math.isnan(auc):
        return counts
    interval = "" if math.isnan(low) else f" [{low:.2f} {high:.2f}]"
    return f"{auc:.3f}{interval} {counts}"
