"""The runs of the paper's tables, and our values beside the printed ones."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from experiments.paper.printed import MFOW, Claim, paper
from experiments.sweeps.cases import SHOWN, CaseRow
from experiments.sweeps.figures import drawings
from experiments.sweeps.plan import CASE, Base, Case, Label, Plan, make_plan
from experiments.sweeps.stats import Estimate, with_interval
from monitor.figures.style import Drawing
from monitor.tables.table import Table
from patrol.errors import BadInput, did_you_mean

FAR_OFF = 1.25
"""A value that differs from the paper's by more than this factor, either way, is marked."""


@dataclass(frozen=True, slots=True)
class Cell:
    """One value of a table, the printed one and ours."""

    table: int  # its number
    row: str
    column: int | str
    metric: str
    printed: float | None  # None where there is none
    values: Mapping[int, float]  # ours by seed
    found: Estimate | None  # the mean of ours over the seeds; None without any

    @property
    def ratio(self) -> float | None:
        """Our mean divided by the printed value; None without one of them."""
        return self.found.mean / self.printed if self.found is not None and self.printed else None

    @property
    def far_off(self) -> bool:
        """True if our mean differs from the printed value by more than the factor `FAR_OFF`, either way."""
        return self.ratio is not None and not 1.0 / FAR_OFF <= self.ratio <= FAR_OFF

    @property
    def text(self) -> str:
        """Our mean ± half the width of its interval, the printed value in brackets, and the ratio of the two."""
        printed = "" if self.printed is None else f" ({self.printed:g})"
        ratio = "" if self.ratio is None else f"x {self.ratio:.2f}"
        return f"{with_interval(self.found, sign=' ± ')}{printed} {f'**{ratio}**' if self.far_off else ratio}".rstrip()


def plan_of(
    numbers: Sequence[int],
    seeds: Sequence[int],
    settings: Mapping[str, object],
    rows: Collection[str] = (),
    columns: Collection[str] = (),
    *,
    claim: Claim | None = None,
) -> Plan:
    """Return the runs of some tables, each cell with `settings` on top; without names, of all rows and columns.

    With a claim only the cells that it compares are run.
    """
    sides = () if claim is None else (claim.lower, claim.higher)
    compared = {(side.table, side.row, column) for side in sides for column in side.columns}
    tables = {number: paper().table(number) for number in numbers}
    for option, names, there in (
        ("--rows", rows, {row for table in tables.values() for row in table.rows}),
        ("--columns", columns, {str(column) for table in tables.values() for column in table.columns}),
    ):
        for name in names:
            if name not in there:
                raise BadInput(f"{option} {name}: no such name in these tables; {did_you_mean(name, sorted(there))}")
    cases = [
        Case(
            _case_name(number, row, column),
            {**paper().settings, **table.settings, **own, table.field: column, **settings},
            (Label(CASE, CASE, row, given=True), Label(table.field, table.over, str(column), given=False)),
        )
        for number, table in tables.items()
        for row, own in table.rows.items()
        for column in table.columns
        if (not rows or row in rows) and (not columns or str(column) in columns)
        if claim is None or (number, row, column) in compared
    ]
    return make_plan("paper", Base({"name": "paper"}, Path.cwd(), "the paper's tables"), cases, seeds)


def _case_name(number: int, row: str, column: int | str) -> str:
    return f"table {number} {row} {column}"


def cells_of(cases: Sequence[CaseRow]) -> list[Cell]:
    """Return the cells that were run, table by table, measure by measure and row by row."""
    by_case = {row.case: row for row in cases}
    return [
        Cell(number, row, column, metric, value, case.values.get(metric, {}), case.metrics.get(metric))
        for number, table in paper().tables.items()
        for metric, printed in table.printed.items()
        for row, values in printed.items()
        for column, value in zip(table.columns, values, strict=True)
        if (case := by_case.get(_case_name(number, row, column))) is not None
    ]


def cells_table(cells: Sequence[Cell]) -> Table:
    """Return the table of cells.csv."""
    return Table.of(
        {
            "table": cell.table,
            "row": cell.row,
            "column": cell.column,
            "metric": cell.metric,
            "paper": cell.printed,
            "mean": cell.found and cell.found.mean,
            "ci95_low": cell.found and cell.found.low,
            "ci95_high": cell.found and cell.found.high,
            "seeds": len(cell.values),
            "ratio": cell.ratio,
        }
        for cell in cells
    )


def page_parts(cells: Sequence[Cell], settings: Mapping[str, object], seeds: Sequence[int]) -> Iterator[str]:
    """Yield what all cells share, the levels of the tables, and the tables; `settings` are on top."""
    shared = ", ".join(f"`{field}: {value}`" for field, value in {**paper().settings, **settings}.items())
    yield f"Seeds {', '.join(map(str, seeds))}. In all cells: {shared}."
    far_off = sum(cell.far_off for cell in cells)
    yield (
        "MFoW is a maximum, so it depends on the size of the points: compare only runs with the same size. Each cell "
        "shows our mean over the seeds ± half the width of its 95 % interval, the printed value in brackets, and the "
        f"ratio of the two, bold where they differ by more than a factor of {FAR_OFF:g}: {far_off} of "
        f"{sum(cell.ratio is not None for cell in cells)}."
    )
    yield from _levels_section(cells)
    yield from _table_sections(cells)


def _table_sections(cells: Sequence[Cell]) -> Iterator[str]:
    """Yield a section for each table, with ours beside the printed values."""
    for number in dict.fromkeys(cell.table for cell in cells):
        table = paper().table(number)
        by_row: dict[str, dict[int | str, str]] = {}
        for cell in cells:
            if cell.table == number:
                title = " (s)" if cell.metric == MFOW else f", {SHOWN[cell.metric]}"
                by_row.setdefault(f"{cell.row}{title}", {})[cell.column] = cell.text
        shown = next(iter(by_row.values()))
        yield f"## Table {number}: {table.title}"
        yield f"Assumed: {'; '.join(table.assumed)}."
        rows = [[title, *texts.values()] for title, texts in by_row.items()]
        yield Table([table.over, *map(str, shown)], rows, range(1, len(shown) + 1)).markdown()


def _levels_section(cells: Sequence[Cell]) -> Iterator[str]:
    """Yield the level of each table's MFoW, the factor by which all its cells differ, and what is left without it."""
    logs: dict[int, list[float]] = {}
    for cell in cells:
        if cell.metric == MFOW and cell.ratio:
            logs.setdefault(cell.table, []).append(math.log(cell.ratio))
    rows = []
    for number, values in logs.items():
        level = math.fsum(values) / len(values)
        spread = math.sqrt(math.fsum((value - level) ** 2 for value in values) / len(values))
        far_off = [sum(abs(value - off) > math.log(FAR_OFF) for value in values) for off in (0.0, level)]
        rows.append((number, len(values), far_off[0], f"{math.exp(level):.2f}", far_off[1], f"{spread:.3f}"))
    yield "## Levels"
    yield (
        "The level of a table is the geometric mean of its ratios of MFoW; another terrain may have another. "
        f"Off are cells beyond a factor of {FAR_OFF:g}; the spread is the standard deviation of the ratios' logarithms."
    )
    yield Table(("table", "cells", "off", "level", "off without the level", "spread"), rows).markdown()


def table_drawings(cases: Sequence[CaseRow], cells: Sequence[Cell]) -> list[Drawing]:
    """Draw our values, with the printed ones as marks: for each table and measure."""
    printed = {
        (_case_name(cell.table, cell.row, cell.column), cell.metric): cell.printed
        for cell in cells
        if cell.printed is not None
    }
    by_case = {row.case: row for row in cases}
    drawn = []
    for number, table in paper().tables.items():
        rows: dict[str, CaseRow] = {}
        for cell in cells:
            if cell.table == number:
                name = _case_name(number, cell.row, cell.column)
                rows[name] = by_case[name]
        shown = {metric: SHOWN[metric] for metric in table.printed}
        figures = drawings(list(rows.values()), f"Table {number}: {table.title}", shown=shown, printed=printed)
        drawn += [replace(figure, name=f"table-{number}-{figure.name}") for figure in figures]
    return drawn
