"""The data of the paper: its Tables 2 to 8 as printed, the settings of each cell, and its conclusions.

`paper_data.json` beside this file holds the data. It also holds, in words, what is assumed where the paper leaves
something open; that is shown with every table.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from typing import Any

from patrol.errors import BadInput, did_you_mean


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
        """Return the table with some of its rows and columns.

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
        """Return the name of the case of a cell.

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
    """The reason why some cells differ from the printed ones.

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

    def applies_to(self, table: int, row: str, column: str) -> bool:
        """Return whether the remark is about a cell.

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
        """Return a table.

        Args:
            number: Its number.

        Raises:
            BadInput: There is no such table.
        """
        if number not in self.tables:
            known = f"{min(self.tables)} to {max(self.tables)}"
            raise BadInput(f"table {number}: no such table; choose from {known}")
        return self.tables[number]

    def sensor_range(self, point: float) -> SensorRange:
        """Return the calibrated sensor range for a size of points, or for the nearest size that has one.

        Args:
            point: Side of one grid point, m.
        """
        return min(self.sensor_ranges, key=lambda found: abs(found.point - point))


@cache
def paper() -> Paper:
    """Return the data of the paper, read once."""
    raw = json.loads(files("experiments.paper").joinpath("paper_data.json").read_text(encoding="utf-8"))
    return Paper(
        source=raw["source"],
        settings=raw["set"],
        sensor_ranges=tuple(SensorRange(**found) for found in raw["sensor_ranges"]),
        fit_tables=tuple(raw["fit"]["tables"]),
        fit_below=raw["fit"]["below"],
        tables={table["number"]: _table(table) for table in raw["tables"]},
        orderings=tuple(
            Ordering(ordering["says"], _side(ordering["lower"]), _side(ordering["higher"]))
            for ordering in raw["orderings"]
        ),
        remarks=tuple(
            Remark(remark["table"], tuple(remark.get("rows", ())), tuple(remark.get("columns", ())), remark["says"])
            for remark in raw["remarks"]
        ),
    )


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
            Measure(
                measure["name"],
                measure["metric"],
                measure["title"],
                measure["unit"],
                tuple(tuple(row) for row in measure["values"]),
            )
            for measure in raw["measures"]
        ),
    )


def _side(raw: Mapping[str, Any]) -> Side:
    return Side(raw["table"], raw["row"], tuple(raw["columns"]))
