"""The paper's claims, tested on our values with confidence intervals."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from experiments.paper.printed import Claim, Side, paper
from experiments.paper.tables import Cell
from experiments.sweeps.stats import Estimate, estimate
from monitor.tables.table import Table

HOLDS = "holds"
FAILS = "fails"
UNDECIDED = "undecided"

Logs = Mapping[tuple[int | str, int], float]
"""Logarithms of values by column and seed."""


def ratio_of(claim: Claim, cells: Sequence[Cell]) -> Estimate | None:
    """Return the ratio of the lower side to the higher: geometric mean with its 95 % interval; None without values.

    Sides with the same columns are compared cell by cell and seed by seed. Otherwise, the geometric means over the
    columns of each side are compared seed by seed. Values of 0 have no ratio and are left out.
    """
    lower, higher = (_log_values(side, cells) for side in (claim.lower, claim.higher))
    if claim.lower.columns != claim.higher.columns:
        lower, higher = _by_seed(lower), _by_seed(higher)
    differences = [value - higher[key] for key, value in lower.items() if key in higher]
    if not differences:
        return None
    log_ratio = estimate(differences)
    low, high = (None if end is None else math.exp(end) for end in (log_ratio.low, log_ratio.high))
    return Estimate(math.exp(log_ratio.mean), low, high, log_ratio.count)


def verdict_of(ratio: Estimate | None) -> str:
    """Return `HOLDS` if the interval lies below 1, `FAILS` if it lies above, otherwise `UNDECIDED`."""
    if ratio is None or ratio.low is None or ratio.high is None:
        return UNDECIDED
    return HOLDS if ratio.high < 1.0 else FAILS if ratio.low > 1.0 else UNDECIDED


def printed_ratio(claim: Claim) -> float | None:
    """Return the same ratio of the printed values, the mean over the columns; None where the paper prints none."""
    lower, higher = (_printed_logs(side) for side in (claim.lower, claim.higher))
    if claim.lower.columns == claim.higher.columns:
        pairs = [(low, high) for low, high in zip(lower, higher, strict=True) if low is not None and high is not None]
        lower, higher = [low for low, _ in pairs], [high for _, high in pairs]
    below, above = ([log for log in logs if log is not None] for logs in (lower, higher))
    return math.exp(math.fsum(below) / len(below) - math.fsum(above) / len(above)) if below and above else None


def claims_table(cells: Sequence[Cell]) -> Table:
    """Return the table of claims.csv: the claims whose cells were run, and whether they hold here."""
    return Table.of(
        {
            "claim": name,
            "says": claim.says,
            "verdict": verdict_of(ratio),
            "ratio": ratio.mean,
            "ci95_low": ratio.low,
            "ci95_high": ratio.high,
            "printed": printed_ratio(claim),
        }
        for name, claim in paper().claims.items()
        if (ratio := ratio_of(claim, cells)) is not None
    )


def claims_section(table: Table) -> Iterator[str]:
    """Yield the table of claims for people."""
    if not table.rows:
        return
    yield "## The paper's claims"
    yield (
        "The ratio divides the side that should be lower by the other side; it is a geometric mean over the cells "
        "named and the seeds. The claim holds if its 95 % interval lies below 1, and fails if it lies above 1."
    )
    rows = [
        (name, says, verdict, _ratio_text(*ratio), "-" if printed is None else f"{printed:.2f}")
        for name, says, verdict, *ratio, printed in table.rows
    ]
    yield Table(("claim", "the paper says", "here", "ratio, 95 % interval", "printed"), rows).markdown()


def _ratio_text(mean: float, low: float | None, high: float | None) -> str:
    return f"{mean:.3f}" if low is None or high is None else f"{mean:.3f} [{low:.3f}, {high:.3f}]"


def _printed_logs(side: Side) -> list[float | None]:
    table = paper().table(side.table)
    values = dict(zip(table.columns, table.printed[side.metric][side.row], strict=True))
    return [None if (value := values[column]) is None else math.log(value) for column in side.columns]


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
