"""The runs of the paper's tables, and our values beside the printed ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import fmean, median
from typing import Any

from experiments.paper.printed import PaperTable, Variant, paper
from experiments.sweeps.plan import Base, Case, Plan, make_plan
from experiments.sweeps.runner import SweepOutcome
from experiments.sweeps.stats import Estimate, Fit, estimate, fit
from monitor.tables.table import Table

CALLED = "the paper's tables"
MFOW = "mfow_mean_s"
"""Name of the paper's score among a run's metrics."""

FAR_OFF = 1.5
"""A value that differs from the paper's by more than this factor, either way, is marked."""


@dataclass(frozen=True, slots=True)
class PaperSetup:
    """The settings that all cells share, besides their own."""

    point: float  # side of one grid point, m
    sensor_range: float  # m
    seeds: tuple[int, ...]
    # what else every cell sets in the scenario, by dotted field
    settings: Mapping[str, object] = field(default_factory=dict)


def plan_of(tables: Sequence[PaperTable], setups: Mapping[str, PaperSetup]) -> Plan:
    """Return the runs of some tables, each cell with each setup.

    The setups are given by the ends of the cases' names; all have the same seeds.
    """
    cases = [
        Case(f"{table.case(row.name, column.name)}{end}", _cell_settings(table, row, column, setup))
        for end, setup in setups.items()
        for table in tables
        for row in table.rows
        for column in table.columns
    ]
    (seeds,) = {setup.seeds for setup in setups.values()}
    return make_plan("paper", Base({"name": "paper"}, Path.cwd(), CALLED), cases, seeds)


@dataclass(frozen=True, slots=True)
class Cell:
    """One value of a table, the printed one and ours."""

    row: str  # its name, with the measure's suffix
    column: str  # its name
    unit: str
    paper: float | None  # the printed value; None where there is none
    values: Mapping[int, float]  # ours by seed
    # of the same runs by seed, s; empty where the value is no mean MFoW
    mean_fog: Mapping[int, float] = field(default_factory=dict)

    @property
    def found(self) -> Estimate | None:
        """The mean of our values over the seeds; None without any."""
        return estimate(list(self.values.values())) if self.values else None

    @property
    def ratio(self) -> float | None:
        """Our mean divided by the printed value; None without one of them."""
        value = self.found
        return value.mean / self.paper if value is not None and self.paper else None

    @property
    def to_mean_fog(self) -> float | None:
        """Mean MFoW divided by mean fog, mean over the seeds; None without both."""
        ratios = [value / fog for seed, value in self.values.items() if (fog := self.mean_fog.get(seed))]
        return fmean(ratios) if ratios else None

    @property
    def far_off(self) -> bool:
        """True if our mean differs from the printed value by more than the factor `FAR_OFF`, either way."""
        ratio = self.ratio
        return ratio is not None and not 1.0 / FAR_OFF <= ratio <= FAR_OFF


@dataclass(frozen=True, slots=True)
class TableComparison:
    """A table, our values beside the printed ones."""

    table: PaperTable
    setup: PaperSetup  # all cells were run with it
    cells: tuple[Cell, ...]  # measure by measure and row by row
    computing_s: float  # processor time of all its runs; wall time in results of older versions

    def cell(self, row: str, column: str) -> Cell | None:
        """Return a cell, or None if there is no such cell; the row's name has its measure's suffix."""
        return next((cell for cell in self.cells if (cell.row, cell.column) == (row, column)), None)


def compare(table: PaperTable, setup: PaperSetup, outcome: SweepOutcome, end: str = "") -> TableComparison:
    """Compare our values with a table; the names of the setup's cases end with `end`."""
    cells = []
    for measure in table.measures:
        is_mfow = measure.metric == MFOW
        for row, printed in zip(table.rows, measure.values, strict=True):
            for column, value in zip(table.columns, printed, strict=True):
                case = f"{table.case(row.name, column.name)}{end}"
                fog = outcome.values(case, "fog_mean_s") if is_mfow else {}
                values = outcome.values(case, measure.metric)
                cells.append(Cell(row.name + measure.suffix, column.name, measure.unit, value, values, fog))
    cases = {f"{table.case(row.name, column.name)}{end}" for row in table.rows for column in table.columns}
    keys = {run.key for run in outcome.plan.runs if run.case in cases}
    return TableComparison(
        table, setup, tuple(cells), sum(outcome.results[key].computing_s for key in keys & set(outcome.results))
    )


def to_mean_fog_text(comparison: TableComparison) -> str | None:
    """Return the ratios of mean MFoW to mean fog over a table's cells in words, or None without any.

    For example "MFoW : mean fog 2.1 to 3.4, median 2.6".
    """
    ratios = [ratio for cell in comparison.cells if (ratio := cell.to_mean_fog) is not None]
    if not ratios:
        return None
    return f"MFoW : mean fog {min(ratios):.1f} to {max(ratios):.1f}, median {median(ratios):.1f}"


def fit_of(comparisons: Sequence[TableComparison], below: float | None = None) -> Fit | None:
    """Compute how well our mean MFoWs fit the printed ones; None if there is nothing to compare.

    Only cells whose printed value is below `below`, s, are used; None for all cells.
    """
    pairs = [
        (value.mean, cell.paper)
        for comparison in comparisons
        for cell in comparison.cells
        if cell.unit == "s" and cell.paper is not None and (below is None or cell.paper < below)
        if (value := cell.found) is not None and value.mean > 0.0
    ]
    return fit([ours for ours, _ in pairs], [theirs for _, theirs in pairs]) if pairs else None


def fits_of(comparisons: Sequence[TableComparison]) -> list[tuple[str, Fit]]:
    """Return the fit of each table, and of those together that the sensor range is fitted to, each with its name.

    The latter are there twice, first by their cells below the paper's limit, and only if all of them were run.
    """
    fits = [(f"Table {comparison.table.number}", fit_of([comparison])) for comparison in comparisons]
    fitted = [comparison for comparison in comparisons if comparison.table.number in paper().fit_tables]
    if len(fitted) == len(paper().fit_tables):
        names = " and ".join(str(number) for number in paper().fit_tables)
        fits.append((f"Tables {names}, printed below {paper().fit_below:g} s", fit_of(fitted, paper().fit_below)))
        fits.append((f"Tables {names}, all", fit_of(fitted)))
    return [(name, fit) for name, fit in fits if fit is not None]


def fit_texts(found: Fit) -> list[str]:
    """Return median ratio, error and correlation of a fit as texts."""
    correlation = "-" if found.correlation is None else f"{found.correlation:.3f}"
    return [f"{found.median_ratio:.3f}", f"{found.rms_log_error:.3f}", correlation]


def as_json(comparison: TableComparison) -> dict[str, Any]:
    """Return the content of table_N.json.

    ``ci95`` is [low, high], ``seeds`` the number of values; ``values`` holds them by seed.
    """
    setup = comparison.setup
    return {
        "table": comparison.table.number,
        "title": comparison.table.title,
        "point": setup.point,
        "sensor_range": setup.sensor_range,
        "assumed": list(comparison.table.assumed),
        "set": dict(setup.settings),
        "run_computing_s": comparison.computing_s,
        "cells": [
            {
                "row": cell.row,
                "column": cell.column,
                "unit": cell.unit,
                "paper": cell.paper,
                "mean": cell_value.mean if (cell_value := cell.found) else None,
                "ci95": cell_value.interval if cell_value else None,
                "seeds": len(cell.values),
                "ratio": cell.ratio,
                "to_mean_fog": cell.to_mean_fog,
                "values": {str(seed): value for seed, value in cell.values.items()},
            }
            for cell in comparison.cells
        ],
    }


def as_table(comparison: TableComparison) -> Table:
    """Return the content of table_N.csv."""
    heads = ["row", "column", "unit", "paper", "mean", "ci95_low", "ci95_high", "seeds", "ratio", "to_mean_fog"]
    rows = []
    for cell in comparison.cells:
        value = cell.found
        numbers = [None, None, None] if value is None else [value.mean, value.low, value.high]
        ratios = (cell.ratio, cell.to_mean_fog)
        rows.append([cell.row, cell.column, cell.unit, cell.paper, *numbers, len(cell.values), *ratios])
    return Table(heads, rows)


def _cell_settings(table: PaperTable, row: Variant, column: Variant, setup: PaperSetup) -> dict[str, object]:
    return {
        **paper().settings,
        **table.settings,
        **row.settings,
        **column.settings,
        "point": setup.point,
        "sensor.range": setup.sensor_range,
        **setup.settings,
    }
