"""The table of a sweep for a paper: the columns that are asked for, narrow enough for a column of a journal."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from experiments.sweeps.cases import (
    PAIRING,
    SHOWN,
    TEST,
    CaseRow,
    bare,
    p_text,
    paired_tests,
    partner_text,
    told_apart,
    write_text,
)
from experiments.sweeps.stats import with_interval
from monitor.tables.table import Table
from patrol.errors import BadInput, did_you_mean

CHANGE, P, RUNS = "change", "p", "runs"
"""Columns beside the metrics: change and p are those of the first metric, and stand where cases are compared."""

COLUMNS = ("mfow_mean_s", CHANGE, P)
"""Columns unless others are asked for."""


def check_columns(columns: Sequence[str]) -> None:
    """Refuse columns that are none of `SHOWN`'s metrics, change, p and runs."""
    known = (*SHOWN, CHANGE, P, RUNS)
    option = f"--table {','.join(columns)}"
    for column in columns:
        if column not in known:
            raise BadInput(f"{option}: {column or 'nothing'}: no such column; {did_you_mean(column, known)}")
    if SHOWN.keys().isdisjoint(columns):
        raise BadInput(f"{option}: names no metric; add one, such as {COLUMNS[0]}")


def write_latex(rows: Sequence[CaseRow], sweep: str, columns: Sequence[str], file: Path) -> None:
    """Write a table with a column for each axis that varies, then the columns that are asked for."""
    metric = next(column for column in columns if column in SHOWN)
    tests = {test.case: test for test in paired_tests(rows) if test.metric == metric}
    heads = {**SHOWN, CHANGE: "change (%)", P: P, RUNS: RUNS}
    shown = [column for column in columns if tests or column not in (CHANGE, P)]
    axes = dict.fromkeys((label.axis, label.title) for row in rows for label in row.labels)
    texts = {title: [label.text for row in rows for label in row.labels if label.axis == axis] for axis, title in axes}
    names, _ = told_apart({row.case: row.words for row in rows})
    varied = {title: column for title, column in texts.items() if len(set(column)) > 1} or {
        "case": list(names.values())
    }

    def cell(row: CaseRow, column: str) -> str:
        if column == RUNS:
            return str(row.runs)
        if column == P:
            return p_text(tests[row.case].p_holm) if row.case in tests else "-"
        return with_interval(row.change.get(metric) if column == CHANGE else row.metrics.get(column))

    numbered = [[cell(row, column) for column in shown] for row in rows]
    cells = [[*labels, *numbers] for numbers, *labels in zip(numbered, *varied.values(), strict=True)]
    counts = sorted({row.runs for row in rows})
    runs = f"{counts[0]} runs" if len(counts) == 1 else f"{counts[0]} to {counts[-1]} runs"
    caption = f"{sweep}: means over {runs} of each case, with half the width of their 95 % interval."
    if tests:
        compared = sum(test.p is not None for test in tests.values())
        caption += (
            f" Change of {bare(SHOWN[metric])} against {partner_text(rows)}; p of a {TEST} over "
            f"runs with the {PAIRING}, corrected for {compared} comparisons by Holm's method."
        )
    places = range(len(varied), len(varied) + len(shown))
    write_text(file, Table([*varied, *(heads[column] for column in shown)], cells, places).latex(caption, sweep))
