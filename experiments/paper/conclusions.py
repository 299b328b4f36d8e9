"""The paper's conclusions from its tables, tested on our values with confidence intervals."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from experiments.paper.printed import Conclusion, Side, paper
from experiments.paper.tables import Cell
from experiments.sweeps.stats import Estimate, estimate
from monitor.tables.table import Table

HELD = "held"
NOT_HELD = "not held"
UNDECIDED = "undecided"

Logs = Mapping[tuple[int | str, int], float]
"""Logarithms of values by column and seed."""


def ratio_of(conclusion: Conclusion, cells: Sequence[Cell]) -> Estimate | None:
    """Return the ratio of the lower side to the higher: geometric mean with its 95 % interval; None without values.

    Sides with the same columns are compared cell by cell and seed by seed. Otherwise, the geometric means over the
    columns of each side are compared seed by seed. Values of 0 have no ratio and are left out.
    """
    lower, higher = (_log_values(side, cells) for side in (conclusion.lower, conclusion.higher))
    if conclusion.lower.columns != conclusion.higher.columns:
        lower, higher = _by_seed(lower), _by_seed(higher)
    differences = [value - higher[key] for key, value in lower.items() if key in higher]
    if not differences:
        return None
    log_ratio = estimate(differences)
    low, high = (None if end is None else math.exp(end) for end in (log_ratio.low, log_ratio.high))
    return Estimate(math.exp(log_ratio.mean), low, high, log_ratio.count)


def verdict_of(ratio: Estimate | None) -> str:
    """Return `HELD` if the interval lies below 1, `NOT_HELD` if it lies above, otherwise `UNDECIDED`."""
    if ratio is None or ratio.low is None or ratio.high is None:
        return UNDECIDED
    return HELD if ratio.high < 1.0 else NOT_HELD if ratio.low > 1.0 else UNDECIDED


def conclusions_section(cells: Sequence[Cell]) -> Iterator[str]:
    """Yield the conclusions whose tables were run, and whether they hold here."""
    run = {cell.table for cell in cells}
    rows = []
    for conclusion in paper().conclusions:
        if {conclusion.lower.table, conclusion.higher.table} <= run:
            ratio = ratio_of(conclusion, cells)
            text = "-" if ratio is None else f"{ratio.mean:.3f}"
            if ratio is not None and ratio.low is not None and ratio.high is not None:
                text += f" [{ratio.low:.3f}, {ratio.high:.3f}]"
            rows.append([conclusion.says, verdict_of(ratio), text])
    if rows:
        yield "## The paper's conclusions"
        yield (
            "The ratio divides the side that should be lower by the other side; it is a geometric mean over the cells "
            "named and the seeds. Held: its 95 % interval lies below 1. Not held: it lies above 1."
        )
        yield Table(("conclusion", "here", "ratio, 95 % interval"), rows).markdown()


def _log_values(side: Side, cells: Sequence[Cell]) -> Logs:
    place = (side.table, side.row, side.metric)
    return {
        (cell.column, seed): math.log(value)
        for cell in cells
        if (cell.table, cell.row, cell.metric) == place and cell.column in side.columns
        for seed, value in cell.values.items()
        if value > 0.0
    }


def _by_seed(logs: Logs) -> Logs:
    """Return the means over the columns by seed, of the seeds that have all columns."""
    columns = {column for column, _ in logs}
    complete = [seed for seed in {seed for _, seed in logs} if all((column, seed) in logs for column in columns)]
    return {("", seed): math.fsum(logs[column, seed] for column in columns) / len(columns) for seed in complete}
