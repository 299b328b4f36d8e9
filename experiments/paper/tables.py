"""The paper's Tables 2 to 8: the settings of each cell, the printed values, and ours.

`paper_data.json` beside this file holds the printed values and the settings. It also holds, in words, what is assumed
where the paper leaves something open; that is shown with every table.
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
"""A value that differs from the paper's by more than this factor, either way, is marked."""


@dataclass(frozen=True, slots=True)
class Variant:
    """A row or column of a table.

    Attributes:
        name: Its name.
        settings: What it sets in the scenario: values by dotted field.
    """

    name: str
    settings: Mapping[str, object]


@dataclass(frozen=True, slots=True)
class Measure:
    """A measure that a table prints.

    Attributes:
        suffix: What the names of its rows end with.
        metric: Name of the metric in a run's results.
        title: Its title.
        unit: Its unit.
        values: The printed values by row and column; None where the paper prints words or nothing.
    """

    suffix: str
    metric: str
    title: str
    unit: str
    values: tuple[tuple[float | None, ...], ...]


@dataclass(frozen=True, slots=True)
class PaperTable:
    """One of the paper's tables.

    Attributes:
        number: Its number.
        title: Its title.
        columns_are: What the columns vary.
        settings: What all its cells set in the scenario, by dotted field.
        assumed: What is assumed where the paper leaves something open.
        rows: Its rows.
        columns: Its columns.
        measures: What it prints.
    """

    number: int
    title: str
    columns_are: str
    settings: Mapping[str, object]
    assumed: tuple[str, ...]
    rows: tuple[Variant, ...]
    columns: tuple[Variant, ...]
    measures: tuple[Measure, ...]

    def part(self, rows: Sequence[str], columns: Sequence[str]) -> PaperTable:
        """The table with some of its rows and columns.

        Args:
            rows: Names of the rows to keep; all where there are none.
            columns: Names of the columns to keep; all where there are none.

        Raises:
            BadInput: A name is unknown.
        """
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
        """The name of the case of a cell.

        Args:
            row: Name of its row.
            column: Name of its column.
        """
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
    """The sensor range that fits Tables 2 and 3 for a size of points.

    Attributes:
        point: Side of one grid point, m.
        range: The sensor range, m.
        found: How it was found.
    """

    point: float
    range: float
    found: str


@dataclass(frozen=True, slots=True)
class Side:
    """Some cells of one row, one side of a conclusion.

    Attributes:
        table: Number of the table.
        row: Name of the row.
        columns: Names of the columns.
    """

    table: int
    row: str
    columns: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Ordering:
    """A conclusion of the paper: the values of one side are lower than those of the other.

    Attributes:
        says: The conclusion in words.
        lower: The side that should be lower.
        higher: The other side.
    """

    says: str
    lower: Side
    higher: Side


@dataclass(frozen=True, slots=True)
class Remark:
    """Why some cells differ from the printed ones.

    Attributes:
        table: Number of the table.
        rows: Names of the rows; all where there are none.
        columns: Names of the columns; all where there are none.
        says: The reason.
    """

    table: int
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    says: str

    def is_on(self, table: int, row: str, column: str) -> bool:
        """Whether the remark is about a cell.

        Args:
            table: Number of the cell's table.
            row: Name of its row.
            column: Name of its column.
        """
        named = (not self.rows or row in self.rows) and (not self.columns or column in self.columns)
        return table == self.table and named


@dataclass(frozen=True, slots=True)
class Paper:
    """The data of the paper.

    Attributes:
        source: Where the data is from.
        settings: What every cell sets in the scenario, by dotted field.
        sensor_ranges: The calibrated sensor ranges.
        fit_tables: Numbers of the tables that a sensor range is fitted to.
        fit_below: The fit uses the cells of these tables whose printed value is below this, s.
        tables: The tables by number.
        orderings: The conclusions.
        remarks: Why some cells differ.
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
        """A table.

        Args:
            number: Its number.

        Raises:
            BadInput: There is no such table.
        """
        if number not in self.tables:
            known = f"{min(self.tables)} to {max(self.tables)}"
            raise BadInput(f"table {number}: no such table; tables {known} can be run")
        return self.tables[number]

    def sensor_range(self, point: float) -> SensorRange:
        """The calibrated sensor range for a size of points, or for the nearest size that has one.

        Args:
            point: Side of one grid point, m.
        """
        return min(self.sensor_ranges, key=lambda found: abs(found.point - point))


@cache
def paper() -> Paper:
    """The data of the paper, read once."""
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
    """What all cells are run with, besides their own settings.

    Attributes:
        point: Side of one grid point, m.
        sensor_range: Sensor range, m.
        seeds: The seeds.
        settings: What else every cell sets in the scenario, by dotted field.
    """

    point: float
    sensor_range: float
    seeds: tuple[int, ...]
    settings: Mapping[str, object] = field(default_factory=dict)


def plan_of(tables: Sequence[PaperTable], setups: Mapping[str, PaperSetup]) -> Plan:
    """The runs of some tables.

    Args:
        tables: The tables.
        setups: The setups that each cell is run with, by the ends of the cases' names; all with the same seeds.

    Returns:
        The plan.

    Raises:
        BadInput: A cell's scenario is not accepted.
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
    """One value of a table, the printed one and ours.

    Attributes:
        row: Name of its row.
        column: Name of its column.
        unit: Its unit.
        paper: The printed value, or None.
        values: Our values by seed.
    """

    row: str
    column: str
    unit: str
    paper: float | None
    values: Mapping[int, float]

    @property
    def found(self) -> Estimate | None:
        """The mean of our values over the seeds; None without any."""
        return estimate(list(self.values.values())) if self.values else None

    @property
    def ratio(self) -> float | None:
        """Our mean divided by the printed value; None without one of them."""
        found = self.found
        return found.mean / self.paper if found is not None and self.paper else None

    @property
    def far_off(self) -> bool:
        """Whether our mean differs from the printed value by more than the factor `FAR_OFF`, either way."""
        ratio = self.ratio
        return ratio is not None and not 1.0 / FAR_OFF <= ratio <= FAR_OFF


@dataclass(frozen=True, slots=True)
class TableComparison:
    """A table, our values beside the printed ones.

    Attributes:
        table: The table.
        setup: What all cells were run with.
        cells: The cells, measure by measure and row by row.
        wall_s: Wall time of all its runs, s.
    """

    table: PaperTable
    setup: PaperSetup
    cells: tuple[Cell, ...]
    wall_s: float

    def cell(self, row: str, column: str) -> Cell | None:
        """A cell.

        Args:
            row: Name of its row, with its measure's suffix.
            column: Name of its column.

        Returns:
            The cell, or None if there is no such cell.
        """
        return next((cell for cell in self.cells if (cell.row, cell.column) == (row, column)), None)


def compare(table: PaperTable, setup: PaperSetup, outcome: SweepOutcome, end: str = "") -> TableComparison:
    """Compare our values with a table.

    Args:
        table: The table.
        setup: What all cells were run with.
        outcome: The results of the plan.
        end: What the names of the setup's cases end with.
    """
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
    """How well our mean MFoWs fit the printed ones.

    Args:
        comparisons: The tables.
        below: Use only cells whose printed value is below this, s; None for all cells.

    Returns:
        The fit, or None if there is nothing to compare.
    """
    pairs = [
        (found.mean, cell.paper)
        for comparison in comparisons
        for cell in comparison.cells
        if cell.unit == "s" and cell.paper is not None and (below is None or cell.paper < below)
        if (found := cell.found) is not None and found.mean > 0.0
    ]
    return fit([ours for ours, _ in pairs], [theirs for _, theirs in pairs]) if pairs else None


def as_json(comparison: TableComparison) -> dict[str, Any]:
    """The content of table_N.json.

    Args:
        comparison: The table.

    Returns:
        The content. ``ci95`` is [low, high], ``seeds`` the number of values, ``values`` holds them by seed.
    """
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
    """The content of table_N.csv.

    Args:
        comparison: The table.

    Yields:
        The values of each line.
    """
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
