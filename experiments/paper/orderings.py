"""What the paper concludes from its tables, held against our runs with an interval of confidence."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from experiments.paper.tables import Ordering, Side, TableComparison
from experiments.sweeps.stats import Estimate, estimate

HELD = "held"
NOT_HELD = "not held"
UNDECIDED = "undecided"


@dataclass(frozen=True, slots=True)
class Judged:
    """An ordering and what our runs say of it.

    ratio: of the side that should be lower to the other, a geometric mean with its 95 % interval; None without runs.
    """

    ordering: Ordering
    ratio: Estimate | None

    @property
    def verdict(self) -> str:
        """HELD when the interval lies below 1, NOT_HELD when it lies above, otherwise UNDECIDED."""
        if self.ratio is None or self.ratio.low is None or self.ratio.high is None:
            return UNDECIDED
        if self.ratio.high < 1.0:
            return HELD
        return NOT_HELD if self.ratio.low > 1.0 else UNDECIDED


def judge_orderings(orderings: Sequence[Ordering], comparisons: Sequence[TableComparison]) -> list[Judged]:
    """Judge those orderings whose tables were run.

    Sides with the same columns are compared cell by cell and seed by seed; otherwise, seed by seed, the geometric mean
    over the columns of one side with that of the other. Values of 0 have no ratio and are left out.
    """
    tables = {comparison.table.number: comparison for comparison in comparisons}
    return [
        Judged(ordering, _ratio(ordering, tables))
        for ordering in orderings
        if ordering.lower.table in tables and ordering.higher.table in tables
    ]


def as_json(judged: Judged) -> dict[str, Any]:
    """For orderings.json."""
    ratio = judged.ratio
    return {
        "says": judged.ordering.says,
        "verdict": judged.verdict,
        "ratio": ratio.mean if ratio else None,
        "ci95": ratio.interval if ratio else None,
        "pairs": ratio.count if ratio else 0,
    }


def _ratio(ordering: Ordering, tables: Mapping[int, TableComparison]) -> Estimate | None:
    lower, higher = (_logs(side, tables[side.table]) for side in (ordering.lower, ordering.higher))
    if ordering.lower.columns != ordering.higher.columns:
        lower, higher = _by_seed(lower), _by_seed(higher)
    differences = [value - higher[key] for key, value in lower.items() if key in higher]
    if not differences:
        return None
    found = estimate(differences)
    low = None if found.low is None else math.exp(found.low)
    high = None if found.high is None else math.exp(found.high)
    return Estimate(math.exp(found.mean), low, high, found.count)


def _logs(side: Side, comparison: TableComparison) -> dict[tuple[str, int], float]:
    """Logarithms by column and seed."""
    found = {}
    for column in side.columns:
        cell = comparison.cell(side.row, column)
        for seed, value in cell.values.items() if cell else ():
            if value > 0.0:
                found[column, seed] = math.log(value)
    return found


def _by_seed(logs: Mapping[tuple[str, int], float]) -> dict[tuple[str, int], float]:
    """Means over the columns, of the seeds that have all of them."""
    columns = {column for column, _ in logs}
    seeds = dict.fromkeys(seed for _, seed in logs)
    whole = [seed for seed in seeds if all((column, seed) in logs for column in columns)]
    return {("", seed): math.fsum(logs[column, seed] for column in columns) / len(columns) for seed in whole}
