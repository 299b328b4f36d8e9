"""Paired tests of a sweep's cases: does a setting change a metric, judged seed by seed?

Two cases that differ in one setting run with the same seeds: the same starts, faults and draws. The difference of a
metric is taken within each seed, so what the seeds have in common cancels out. For example, an MFoW of 81, 95 and 88 s
against one of 90, 99 and 97 s gives the differences -9, -4 and -9 s.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from experiments.sweeps.stats import Estimate, estimate
from monitor.tables.table import Table

if TYPE_CHECKING:
    from experiments.sweeps.cases import CaseRow

TEST = "two-sided paired t-test"
"""The test whose p-values tables and figures show; it agrees with the intervals of the differences."""

PAIRING = "same seed"


@dataclass(frozen=True, slots=True)
class PairedTest:
    """A metric of a case, compared with the same metric of another."""

    case: str
    against: str
    metric: str
    difference: Estimate  # mean over the seeds that both have, in the metric's unit, with its 95 % interval
    change: Estimate | None  # the same in percent of the other's mean; None where that is not above 0
    # probability of so large a difference if the setting had no effect; None for fewer than two pairs, or equal
    # differences
    p: float | None

    @property
    def pairs(self) -> int:
        """Number of seeds that both cases have a value for."""
        return self.difference.count


def paired_tests(rows: Sequence[CaseRow]) -> list[PairedTest]:
    """Return the tests of all cases that are compared with another.

    The p-values are those of single tests: they are not adjusted for how many there are.
    """
    by_name = {row.case: row for row in rows}
    tests = []
    for row in rows:
        if row.against is None:
            continue
        for metric, by_seed in row.values.items():
            partner = by_name[row.against].values.get(metric, {})
            differences = [by_seed[seed] - partner[seed] for seed in by_seed if seed in partner]
            if differences:
                difference = estimate(differences)
                p = p_of_no_difference(differences)
                tests.append(PairedTest(row.case, row.against, metric, difference, row.change.get(metric), p))
    return tests


def p_of_no_difference(differences: Sequence[float]) -> float | None:
    """Return the p-value of a two-sided t-test that the mean of some differences is 0.

    None for fewer than two differences, and where all are the same.
    """
    count = len(differences)
    if count < 2:
        return None
    mean = math.fsum(differences) / count
    variance = math.fsum((value - mean) ** 2 for value in differences) / (count - 1)
    if variance == 0.0:
        return None
    from scipy.special import stdtr  # an optional dependency, and slow to load

    return 2.0 * float(stdtr(count - 1, -abs(mean) / math.sqrt(variance / count)))


def comparisons_table(tests: Sequence[PairedTest]) -> Table:
    """Return the table of comparisons.csv: a row for each test."""
    heads = [
        "case",
        "against",
        "metric",
        "test",
        "pairing",
        "pairs",
        "difference",
        "low",
        "high",
        "change_percent",
        "p",
    ]
    rows = []
    for test in tests:
        difference, change = test.difference, None if test.change is None else test.change.mean
        ends = (difference.mean, difference.low, difference.high)
        rows.append((test.case, test.against, test.metric, TEST, PAIRING, test.pairs, *ends, change, test.p))
    return Table(heads, rows)
