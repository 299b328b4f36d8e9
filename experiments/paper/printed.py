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

from pydantic import TypeAdapter

from patrol.errors import BadInput, did_you_mean


@dataclass(frozen=True, slots=True)
class Variant:
    """A row or column of a table."""

    name: str
    settings: Mapping[str, object]  # of the scenario, by dotted field


@dataclass(frozen=True, slots=True)
class Measure:
    """A measure that a table prints."""

    suffix: str  # what the names of its rows end with
    metric: str  # its name in a run's results
    title: str
    unit: str
    # printed, by row and column; None where the paper prints words or nothing
    values: tuple[tuple[int | float | None, ...], ...]


@dataclass(frozen=True, slots=True)
class PaperTable:
    """One of the paper's tables."""

    number: int
    title: str
    columns_are: str  # what the columns vary
    settings: Mapping[str, object]  # of all its cells, by dotted field of the scenario
    assumed: tuple[str, ...]  # what is assumed where the paper leaves something open
    rows: tuple[Variant, ...]
    columns: tuple[Variant, ...]
    measures: tuple[Measure, ...]

    def part(self, rows: Sequence[str], columns: Sequence[str]) -> PaperTable:
        """Return the table with the named rows and columns alone; without names, all rows or columns stay."""
        kept_rows = self._find_indexes("row", self.rows, rows)
        kept_columns = self._find_indexes("column", self.columns, columns)
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
        """Return the name of the case of a cell."""
        return f"table {self.number} {row} {column}"

    def _find_indexes(self, kind: str, variants: Sequence[Variant], wanted: Sequence[str]) -> list[int]:
        names = [variant.name for variant in variants]
        for name in wanted:
            if name not in names:
                raise BadInput(
                    f"--{kind}s = {name}: table {self.number} has no such {kind}; {did_you_mean(name, names)}"
                )
        return [index for index, name in enumerate(names) if not wanted or name in wanted]


@dataclass(frozen=True, slots=True)
class SensorRange:
    """The sensor range that fits Tables 2 and 3 for a size of points."""

    point: float  # side of one grid point, m
    range: float  # m
    found: str  # how it was found


@dataclass(frozen=True, slots=True)
class Side:
    """Some cells of one row, one side of a conclusion."""

    table: int
    row: str
    columns: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Ordering:
    """A conclusion of the paper: the values of one side are lower than those of the other."""

    says: str
    lower: Side
    higher: Side


@dataclass(frozen=True, slots=True)
class Remark:
    """The reason why some cells differ from the printed ones."""

    table: int  # its number
    rows: tuple[str, ...] = ()  # their names; all where there are none
    columns: tuple[str, ...] = ()  # their names; all where there are none
    says: str = ""  # the reason

    def applies_to(self, table: int, row: str, column: str) -> bool:
        """Return whether the remark is about a cell."""
        named = (not self.rows or row in self.rows) and (not self.columns or column in self.columns)
        return table == self.table and named


@dataclass(frozen=True, slots=True)
class Paper:
    """The data of the paper."""

    source: str  # where the data is from
    settings: Mapping[str, object]  # of every cell, by dotted field of the scenario
    sensor_ranges: tuple[SensorRange, ...]  # the calibrated ones
    fit_tables: tuple[int, ...]  # numbers of the tables that a sensor range is fitted to
    fit_below: int  # s; the fit uses their cells with a printed value below this
    tables: Mapping[int, PaperTable]  # by number
    orderings: tuple[Ordering, ...]
    remarks: tuple[Remark, ...]

    def table(self, number: int) -> PaperTable:
        """Return a table."""
        if number not in self.tables:
            choices = f"{min(self.tables)} to {max(self.tables)}"
            raise BadInput(f"table {number}: no such table; choose from {choices}")
        return self.tables[number]

    def sensor_range(self, point: float) -> SensorRange:
        """Return the calibrated sensor range for points of a side, m, or of the nearest side that has one."""
        return min(self.sensor_ranges, key=lambda found: abs(found.point - point))


@cache
def paper() -> Paper:
    """Return the data of the paper, read once."""
    raw = json.loads(files("experiments.paper").joinpath("paper_data.json").read_text(encoding="utf-8"))
    raw["tables"] = {table["number"]: table for table in raw["tables"]}
    return TypeAdapter(Paper).validate_python(raw)
