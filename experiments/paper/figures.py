"""Pictures of the paper's tables: our means as bars with their intervals, the printed values as marks.

matplotlib is an optional dependency, so it is imported only when something is drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from experiments.paper.printed import Measure
from experiments.paper.tables import FAR_OFF, TableComparison
from monitor.figures.ground import Key, Layer, canvas, legend, paint, painted, rim, save
from monitor.figures.style import ALERT, INK, SPREAD, colour, drawn, figure, logarithmic, plain, write_figure
from patrol.ground.terrain import Terrain
from patrol.palette import WALL

if TYPE_CHECKING:
    from matplotlib.axes import Axes

GROUP = 0.8
"""Share of a column's width that its bars fill."""


def table_picture(comparison: TableComparison, files: Sequence[Path]) -> None:
    """Draw a table."""
    table, setup = comparison.table, comparison.setup
    measures = table.measures
    bars = len(table.columns) * len(table.rows)
    runs = (
        f"points of {setup.point:g} m, sensor range {setup.sensor_range:g} m, {len(setup.seeds)} seeds, 95 % intervals"
    )
    with drawn():
        chart = figure(max(7.0, 2.0 + 0.3 * bars), 0.9 + 3.4 * len(measures))
        panels = chart.subplots(len(measures), 1, squeeze=False)[:, 0]
        for panel, measure in zip(panels, measures, strict=True):
            _draw_measure(panel, comparison, measure)
        handles, labels = panels[0].get_legend_handles_labels()
        chart.legend(handles, labels, loc="outside right upper", borderpad=1.0)
        chart.suptitle(f"Table {table.number}: {table.title}\n{runs}", x=0.01, ha="left", fontsize=10)
    write_figure(chart, files)


def terrain_picture(terrain: Terrain, file: Path) -> None:
    """Draw a reconstructed terrain."""
    layer = Layer(WALL, "obstacle", ~terrain.passable)
    xmin, ymin, xmax, ymax = terrain.bounds
    title = f"{terrain.name} (a reconstruction): {xmax - xmin:g} x {ymax - ymin:g} m"
    figure, axes = canvas(terrain, title)
    paint(axes, terrain, painted(terrain.shape, [layer]))
    free = np.count_nonzero(terrain.passable) * terrain.point_area
    keys = [Key(WALL, f"obstacles: {(xmax - xmin) * (ymax - ymin) - free:.0f} m²")] * bool(layer.mask.any())
    legend(axes, [*keys, Key("#ffffff", f"free: {free:.0f} m²")])
    save(figure, file)


def _draw_measure(axes: Axes, comparison: TableComparison, measure: Measure) -> None:
    """Draw one measure: a group of bars for each column, a bar for each row, across it the printed value."""
    table = comparison.table
    width = GROUP / len(table.rows)
    marks: dict[bool, list[tuple[float, float]]] = {False: [], True: []}  # x and value; True: far off
    shown: list[float] = []
    for index, row in enumerate(table.rows):
        bars = []
        for number, column in enumerate(table.columns):
            cell = comparison.cell(row.name + measure.suffix, column.name)
            x = number - GROUP / 2.0 + (index + 0.5) * width
            if cell is not None and (estimate := cell.found) is not None:
                bars.append((x, estimate.mean, estimate.half or 0.0))
            if cell is not None and cell.paper is not None:
                marks[cell.far_off].append((x, cell.paper))
        if bars:
            xs, means, halves = np.transpose(bars)
            look: dict[str, Any] = {
                "color": colour(index),
                "ecolor": INK,
                "capsize": 2.0,
                "error_kw": {"elinewidth": 1.0},
            }
            axes.bar(xs, means, 0.92 * width, yerr=np.where(halves > 0.0, halves, np.nan), label=row.name, **look)
            shown += means.tolist()
    for far_off, placed in marks.items():
        if placed:
            name, under = (f"the paper, > {FAR_OFF:g} × off", ALERT) if far_off else ("the paper", "white")
            xs, values = np.transpose(placed)
            gaps = np.full(len(xs), np.nan)
            across = (
                np.column_stack([xs - width / 2.0, xs + width / 2.0, gaps]),
                np.column_stack([values, values, gaps]),
            )
            rims = rim(4.5, under)
            axes.plot(*map(np.ravel, across), label=name, color="black", linewidth=1.8, zorder=5, path_effects=rims)
            shown += values.tolist()
    axes.set_xticks(range(len(table.columns)), [column.name for column in table.columns])
    axes.set_xlabel(table.columns_are)
    axes.set_ylabel(f"{measure.title} ({measure.unit})")
    positive = [value for value in shown if value > 0.0]
    if positive and max(positive) > SPREAD * min(positive):
        logarithmic(axes, "y")
        axes.set_ylim(bottom=min(positive) / 1.5)
    else:
        axes.set_ylim(bottom=0.0)
    plain(axes)
