"""The paper's conclusions from its tables, tested on our values with confidence intervals."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from experiments.paper.printed import Ordering, Side
from experiments.paper.tables import TableComparison
from experiments.sweeps.stats import Estimate, estimate

HELD = "held"
NOT_HELD = "not held"
UNDECIDED = "undecided"


@dataclass(frozen=True, slots=True)
class Judged:
    """A conclusion of the paper and what our values say about it."""

    ordering: Ordering
    ratio: Estimate | None  # lower side to higher, geometric mean with its 95 % interval; None without values

    @property
    def verdict(self) -> str:
        """`HELD` if the interval lies below 1, `NOT_HELD` if it lies above, otherwise `UNDECIDED`."""
        if self.ratio is None or self.ratio.low is None or self.ratio.high is None:
            return UNDECIDED
        if self.ratio.high < 1.0:
            return HELD
        return NOT_HELD if self.ratio.low > 1.0 else UNDECIDED


def judge_orderings(orderings: Sequence[Ordering], comparisons: Sequence[TableComparison]) -> list[Judged]:
    """Judge the conclusions whose tables were run.

    Sides with the same columns are compared cell by cell and seed by seed. Otherwise, the geometric means over the
    columns of each side are compared seed by seed. Values of 0 have no ratio and are left out.
    """
    tables = {comparison.table.number: comparison for comparison in comparisons}
    return [
        Judged(ordering, _ordering_ratio(ordering, tables))
        for ordering in orderings
        if ordering.lower.table in tables and ordering.higher.table in tables
    ]


def as_json(judged: Judged) -> dict[str, Any]:
    """Return one entry of orderings.json."""
    ratio = judged.ratio
    return {
        "says": judged.ordering.says,
        "verdict": judged.verdict,
        "ratio": ratio.mean if ratio else None,
        "ci95": ratio.interval if ratio else None,
        "pairs": ratio.count if ratio else 0,
    }


def _ordering_ratio(ordering: Ordering, tables: Mapping[int, TableComparison]) -> Estimate | None:
    lower, higher = (_log_values(side, tables[side.table]) for side in (ordering.lower, ordering.higher))
    if ordering.lower.columns != ordering.higher.columns:
        lower, higher = _by_seed(lower), _by_seed(higher)
    differences = [value - higher[key] for key, value in lower.items() if key in higher]
    if not differences:
        return None
    log_ratio = estimate(differences)
    low = None if log_ratio.low is None else math.exp(log_ratio.low)
    high = None if log_ratio.high is None else math.exp(log_ratio.high)
    return Estimate(math.exp(log_ratio.mean), low, high, log_ratio.count)


def _log_values(side: Side, comparison: TableComparison) -> dict[tuple[str, int], float]:
    """Return the logarithms of the values by column and seed."""
    logs = {}
    for column in side.columns:
        cell = comparison.cell(side.row, column)
        for seed, value in cell.values.items() if cell else ():
            if value > 0.0:
                logs[column, seed] = math.log(value)
    return logs


def _by_seed(logs: Mapping[tuple[str, int], float]) -> dict[tuple[str, int], float]:
    """Return the means over the columns by seed, of the seeds that have all columns."""
    columns = {column for column, _ in logs}
    seeds = dict.fromkeys(seed for _, seed in logs)
    complete = [seed for seed in seeds if all((column, seed) in logs for column in columns)]
    return {("", seed): math.fsum(logs[column, seed] for column in columns) / len(columns) for seed in complete}
