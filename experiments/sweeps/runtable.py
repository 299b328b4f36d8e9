"""The runs of a sweep as one tidy table: a row a run, with its settings, its numbers and how long it took."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

from experiments.sweeps.plan import Run
from experiments.sweeps.runner import SweepOutcome
from patrol.errors import quoted

Labels = Callable[[Run], Mapping[str, object]]
"""What a table says of a run besides its seed and its results, by column."""


def case_labels(outcome: SweepOutcome) -> Labels:
    """Return labels that give a run's case, and each setting that some case makes; None where a run's does not."""
    fields = dict.fromkeys(field for case in outcome.plan.cases for field in case.settings)
    return lambda run: {"case": run.case, **{field: run.settings.get(field) for field in fields}}


def run_rows(outcome: SweepOutcome, labels: Labels) -> list[dict[str, object]]:
    """Return a row, values by column, for each run of the plan that has a result.

    `labels` gives the first columns. All rows have the same columns, with None where there is no value.
    """
    names = list(dict.fromkeys(name for result in outcome.results.values() for name in result.metrics))
    rows = []
    for run in outcome.plan.runs:
        result = outcome.results.get(run.key)
        if result is None:
            continue
        rows.append(
            {
                **labels(run),
                "seed": run.seed,
                "outcome": result.outcome,
                "error": result.error,
                **{name: result.metrics.get(name) for name in names},
                "trace_hash": result.trace_hash,
                "wall_s": result.wall_s,
                "processor_s": result.processor_s,
                "software": result.software,
            }
        )
    return rows


def table_lines(rows: Sequence[Mapping[str, object]]) -> Iterator[Sequence[object]]:
    """Yield the lines of a CSV file: the headings, then the values of each row.

    All rows have the same columns. Lists and mappings are written as JSON.
    """
    yield list(rows[0]) if rows else []
    for row in rows:
        yield [csv_value(value) for value in row.values()]


def csv_value(value: object) -> object:
    """Return a value as a CSV file holds it: lists and mappings as JSON text."""
    return value if value is None or isinstance(value, str | int | float) else quoted(value)
