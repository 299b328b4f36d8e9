"""The paper's Tables 2 to 8: what each cell is run with, what was printed, and what our runs give.

`paper_data.json` beside this file holds the printed values and the settings. What the paper leaves open is assumed
there in words, and shown with every table.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from experiments.sweeps.plan import Base, Case, Plan, make_plan
from experiments.sweeps.runner import SweepOutcome
from experiments.sweeps.stats import Estimate, Fit, estimate, fit
from patrol.errors import BadInput
from patrol.scenario.explain import did_you_mean

CALLED = "the paper's tables"
FAR_OFF = 1.5
"""A ratio to the paper's value beyond this, either way, is marked."""


@dataclass(frozen=True, slots=True)
class Variant:
    """A row or column of a table: its name and what it sets in the scenario, values by dotted field."""

    name: str
    settings: Mapping[str, object]


@dataclass(frozen=True, slots=True)
class Measure:
    """What a table prints of its runs.

    suffix: of the names of the rows that hold it. metric: of a run's results. values: as printed, by row and column;
    None where the paper says something in words alone.
    """

    suffix: str
    metric: str
    title: str
    unit: str
    values: tuple[tuple[float | None, ...], ...]


@dataclass(frozen=True, slots=True)
class PaperTable:
    """One of the paper's tables. assumed: what the paper leaves open, in words."""

    number: int
    title: str
    columns_are: str
    settings: Mapping[str, object]
    assumed: tuple[str, ...]
    rows: tuple[Variant, ...]
    columns: tuple[Variant, ...]
    measures: tuple[Measure, ...]

    def part(self, rows: Sequence[str], columns: Sequence[str]) -> PaperTable:
        """The table with some of its rows and columns; all of them where none are named. BadInput for unknown ones."""
        kept_rows = self._indexes("row", self.rows, rows)
        kept_columns = self._indexes("column", self.columns, columns)
        measures = tuple(
            replace(measure, values=tuple(tuple(measure.values[i][j] for j in kept_columns) for i in kept_rows))
            for measure in self.measures
        )
        return replace(
            self,
            rows=tuple(self.rows[i] for i in kept_rows),
            columns=tuple(self.columns[j] for j in kept_columns),
            measures=measures,
        )

    def case(self, row: str, column: str) -> str:
        """The name of a cell's case."""
        return f"table {self.number} {row} {column}"

    def _indexes(self, kind: str, variants: Sequence[Variant], wanted: Sequence[str]) -> list[int]:
        names = [variant.name for variant in variants]
        for name in wanted:
            if name not in names:
                raise BadInput(
                    f"--{kind}s = {name}: table {self.number} has no such {kind}; {did_you_mean(name, names)}"
                )
        return [index for index, name in enumerate(names) if not wanted or name in wanted]


@dataclass(frozen=True, slots=True)
class SensorRange:
    """The sensor range (m) that fits Tables 2 and 3 on points of a size (m), and how that was found."""

    point: float
    range: float
    found: str


@dataclass(frozen=True, slots=True)
class Side:
    """Some cells of one row, to be held against others."""

    table: int
    row: str
    columns: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Ordering:
    """Something that the paper concludes: the cells of one side are lower than those of the other."""

    says: str
    lower: Side
    higher: Side


@dataclass(frozen=True, slots=True)
class Remark:
    """Why some cells differ from the printed ones. rows, columns: all of the table's where none are named."""

    table: int
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    says: str

    def is_on(self, table: int, row: str, column: str) -> bool:
        """Whether it speaks of a cell."""
        named = (not self.rows or row in self.rows) and (not self.columns or column in self.columns)
        return table == self.table and named


@dataclass(frozen=True, slots=True)
class Paper:
    """All that is kept of the paper.

    settings: of every cell. fit_tables, fit_below: what a sensor range is fitted to, namely those cells of these
    tables that are printed below so many s.
    """

    source: str
    settings: Mapping[str, object]
    sensor_ranges: tuple[SensorRange, ...]
    fit_tables: tuple[int, ...]
    fit_below: float
    tables: Mapping[int, PaperTable]
    orderings: tuple[Ordering, ...]
    remarks: tuple[Remark, ...]

    def table(self, number: int) -> PaperTable:
        """A table by its number. BadInput for one that is not there."""
        if number not in self.tables:
            known = f"{min(self.tables)} to {max(self.tables)}"
            raise BadInput(f"table {number}: no such table; the paper has {known} that can be run")
        return self.tables[number]

    def sensor_range(self, point: float) -> SensorRange:
        """The radius for points of a size, or for the nearest size for which one has been found."""
        return min(self.sensor_ranges, key=lambda found: abs(found.point - point))


@cache
def paper() -> Paper:
    """The paper's tables."""
    raw = json.loads(files("experiments.paper").joinpath("paper_data.json").read_text(encoding="utf-8"))
    return Paper(
        source=raw["source"],
        settings=raw["set"],
        sensor_ranges=tuple(SensorRange(**found) for found in raw["sensor_ranges"]),
        fit_tables=tuple(raw["fit"]["tables"]),
        fit_below=raw["fit"]["below"],
        tables={table["number"]: _table(table) for table in raw["tables"]},
        orderings=tuple(
            Ordering(says["says"], _side(says["lower"]), _side(says["higher"])) for says in raw["orderings"]
        ),
        remarks=tuple(
            Remark(one["table"], tuple(one.get("rows", ())), tuple(one.get("columns", ())), one["says"])
            for one in raw["remarks"]
        ),
    )


@dataclass(frozen=True, slots=True)
class PaperSetup:
    """What all cells are run with besides their own settings: point and sensor range (m), seeds, further settings."""

    point: float
    sensor_range: float
    seeds: tuple[int, ...]
    settings: Mapping[str, object] = field(default_factory=dict)


def plan_of(tables: Sequence[PaperTable], setups: Mapping[str, PaperSetup]) -> Plan:
    """The runs of tables with each of some setups, whose names end the cases' names.

    BadInput where a cell's scenario is not accepted. All setups need the same seeds.
    """
    cases = [
        Case(f"{table.case(row.name, column.name)}{end}", _settings(table, row, column, setup))
        for end, setup in setups.items()
        for table in tables
        for row in table.rows
        for column in table.columns
    ]
    (seeds,) = {setup.seeds for setup in setups.values()}
    return make_plan("paper", Base({"name": "paper"}, Path.cwd(), CALLED), cases, seeds)


@dataclass(frozen=True, slots=True)
class Cell:
    """One number of a table beside ours. values: ours by seed; found: their mean, None when no run has one."""

    row: str
    column: str
    unit: str
    paper: float | None
    values: Mapping[int, float]

    @property
    def found(self) -> Estimate | None:
        """The mean over seeds."""
        return estimate(list(self.values.values())) if self.values else None

    @property
    def ratio(self) -> float | None:
        """Ours over the paper's."""
        found = self.found
        return found.mean / self.paper if found is not None and self.paper else None

    @property
    def far_off(self) -> bool:
        """Whether ours differs from the paper's by more than `FAR_OFF`, either way."""
        ratio = self.ratio
        return ratio is not None and not 1.0 / FAR_OFF <= ratio <= FAR_OFF


@dataclass(frozen=True, slots=True)
class TableComparison:
    """A table, ours beside the paper's; cells row by row, each measure after the other. wall_s: of all its runs, s."""

    table: PaperTable
    setup: PaperSetup
    cells: tuple[Cell, ...]
    wall_s: float

    def cell(self, row: str, column: str) -> Cell | None:
        """A cell by the names of its row (with its measure's suffix) and column, or None."""
        return next((cell for cell in self.cells if (cell.row, cell.column) == (row, column)), None)


def compare(table: PaperTable, setup: PaperSetup, outcome: SweepOutcome, end: str = "") -> TableComparison:
    """What a table's runs came to; end: of the names of the setup's cases."""
    cells = []
    for measure in table.measures:
        for row, printed in zip(table.rows, measure.values, strict=True):
            for column, value in zip(table.columns, printed, strict=True):
                values = outcome.values(f"{table.case(row.name, column.name)}{end}", measure.metric)
                cells.append(Cell(row.name + measure.suffix, column.name, measure.unit, value, values))
    cases = {f"{table.case(row.name, column.name)}{end}" for row in table.rows for column in table.columns}
    keys = {run.key for run in outcome.plan.runs if run.case in cases}
    return TableComparison(
        table, setup, tuple(cells), sum(outcome.results[key].wall_s for key in keys & set(outcome.results))
    )


def fit_of(comparisons: Sequence[TableComparison], below: float | None = None) -> Fit | None:
    """How near the mean MFoWs come to the printed ones, of those printed below so many s; None without any."""
    pairs = [
        (found.mean, cell.paper)
        for comparison in comparisons
        for cell in comparison.cells
        if cell.unit == "s" and cell.paper is not None and (below is None or cell.paper < below)
        if (found := cell.found) is not None and found.mean > 0.0
    ]
    return fit([ours for ours, _ in pairs], [theirs for _, theirs in pairs]) if pairs else None


def as_json(comparison: TableComparison) -> dict[str, Any]:
    """A comparison for table_N.json. ci95: [low, high]; seeds: how many the mean is over; values: by seed."""
    setup = comparison.setup
    return {
        "table": comparison.table.number,
        "title": comparison.table.title,
        "point": setup.point,
        "sensor_range": setup.sensor_range,
        "assumed": list(comparison.table.assumed),
        "set": dict(setup.settings),
        "run_wall_s": comparison.wall_s,
        "cells": [
            {
                "row": cell.row,
                "column": cell.column,
                "unit": cell.unit,
                "paper": cell.paper,
                "mean": found.mean if (found := cell.found) else None,
                "ci95": found.interval if found else None,
                "seeds": len(cell.values),
                "ratio": cell.ratio,
                "values": {str(seed): value for seed, value in cell.values.items()},
            }
            for cell in comparison.cells
        ],
    }


def as_lines(comparison: TableComparison) -> Iterator[Sequence[object]]:
    """A comparison for table_N.csv."""
    yield ["row", "column", "unit", "paper", "mean", "ci95_low", "ci95_high", "seeds", "ratio"]
    for cell in comparison.cells:
        found = cell.found
        numbers = [None, None, None] if found is None else [found.mean, found.low, found.high]
        yield [cell.row, cell.column, cell.unit, cell.paper, *numbers, len(cell.values), cell.ratio]


def _settings(table: PaperTable, row: Variant, column: Variant, setup: PaperSetup) -> dict[str, object]:
    return {
        **paper().settings,
        **table.settings,
        **row.settings,
        **column.settings,
        "point": setup.point,
        "sensor.range": setup.sensor_range,
        **setup.settings,
    }


def _table(raw: Mapping[str, Any]) -> PaperTable:
    return PaperTable(
        number=raw["number"],
        title=raw["title"],
        columns_are=raw["columns_are"],
        settings=raw["set"],
        assumed=tuple(raw["assumed"]),
        rows=tuple(Variant(row["name"], row["set"]) for row in raw["rows"]),
        columns=tuple(Variant(column["name"], column["set"]) for column in raw["columns"]),
        measures=tuple(
            Measure(one["name"], one["metric"], one["title"], one["unit"], tuple(tuple(row) for row in one["values"]))
            for one in raw["measures"]
        ),
    )


def _side(raw: Mapping[str, Any]) -> Side:
    return Side(raw["table"], raw["row"], tuple(raw["columns"]))
