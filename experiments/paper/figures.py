"""Pictures of the paper's tables: our means as bars with their intervals, the printed values as marks.

matplotlib is an optional dependency, so it is imported only when something is drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from experiments.paper.printed import Measure
from experiments.paper.tables import FAR_OFF, Cell, TableComparison
from fogwatch.pictures.drawing import Key, Layer, canvas, legend, paint, painted, save
from patrol.errors import BadInput
from patrol.extras import check_matplotlib
from patrol.ground.terrain import Terrain
from patrol.palette import WALL

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#f0e442", "#999999")
"""The colours of Okabe and Ito, which colour-blind people can tell apart."""

GROUP = 0.8
"""Share of a column's width that its bars fill."""

LOGARITHMIC = 8.0
"""A measure whose values differ by more than this factor is drawn on a logarithmic scale."""

DPI = 150


def table_picture(comparison: TableComparison, files: Sequence[Path]) -> None:
    """Draw a table."""
    check_matplotlib("experiments")
    from matplotlib.figure import Figure

    table, setup = comparison.table, comparison.setup
    measures = table.measures
    bars = len(table.columns) * len(table.rows)
    size = (max(7.0, 2.0 + 0.3 * bars), 0.9 + 3.4 * len(measures))
    figure = Figure(figsize=size, dpi=DPI, facecolor="white", layout="constrained")
    panels = figure.subplots(len(measures), 1, squeeze=False)[:, 0]
    for panel, measure in zip(panels, measures, strict=True):
        _draw(panel, comparison, measure)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right upper", frameon=False, fontsize=9, borderpad=1.0)
    runs = (
        f"points of {setup.point:g} m, sensor range {setup.sensor_range:g} m, {len(setup.seeds)} seeds, 95 % intervals"
    )
    figure.suptitle(f"Table {table.number}: {table.title}\n{runs}", x=0.01, ha="left", fontsize=10)
    write_figure(figure, files)


def write_figure(figure: Figure, files: Sequence[Path]) -> None:
    """Write a figure."""
    import matplotlib as mpl

    with mpl.rc_context({"svg.hashsalt": "fogwatch"}):
        for file in files:
            dated = {"Date": None} if file.suffix == ".svg" else {"Software": None}
            try:
                figure.savefig(file, metadata=dated)
            except OSError as error:
                raise BadInput(f"{file}: cannot be written ({error.strerror}); choose another --out") from None


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


def _draw(axes: Axes, comparison: TableComparison, measure: Measure) -> None:
    """Draw one measure: a group of bars for each column, a bar for each row."""
    table = comparison.table
    width = GROUP / len(table.rows)
    shown: list[float] = []
    labelled_marks: set[str] = set()
    for index, row in enumerate(table.rows):
        colour = COLOURS[index % len(COLOURS)]
        labelled = False
        for place, column in enumerate(table.columns):
            cell = comparison.cell(row.name + measure.suffix, column.name)
            x = place - GROUP / 2.0 + (index + 0.5) * width
            found = cell.found if cell else None
            if found is not None:
                axes.bar(x, found.mean, 0.92 * width, color=colour, label=None if labelled else row.name, zorder=2)
                labelled = True
                shown.append(found.mean)
                if found.half:
                    axes.errorbar(x, found.mean, found.half, color="#222222", elinewidth=1.0, capsize=2.0, zorder=3)
            if cell is not None and cell.paper is not None:
                _mark(axes, x, width, cell, labelled_marks)
                shown.append(cell.paper)
    axes.set_xticks(range(len(table.columns)), [column.name for column in table.columns])
    axes.set_xlabel(table.columns_are)
    axes.set_ylabel(f"{measure.title} ({measure.unit})")
    positive = [value for value in shown if value > 0.0]
    if positive and max(positive) > LOGARITHMIC * min(positive):
        _logarithmic(axes, min(positive) / 1.5)
    else:
        axes.set_ylim(bottom=0.0)
    axes.grid(axis="y", color="#dddddd", linewidth=0.6, zorder=0)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def _logarithmic(axes: Axes, bottom: float) -> None:
    """Use a logarithmic scale with plain numbers as labels."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.set_yscale("log")
    axes.set_ylim(bottom=bottom)
    axes.yaxis.set_major_locator(LogLocator(10.0, subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())


def _mark(axes: Axes, x: float, width: float, cell: Cell, labelled: set[str]) -> None:
    """Draw the printed value: a black line across the bar's width, on red where our value is far off.

    `labelled` holds the labels that the legend has already.
    """
    from matplotlib.patheffects import withStroke

    assert cell.paper is not None
    label, under = ("the paper", "white") if not cell.far_off else (f"the paper, > {FAR_OFF:g} × off", "#c1121f")
    across = [x - width / 2.0, x + width / 2.0]
    strokes = [withStroke(linewidth=4.5, foreground=under)]
    shown = "_" if label in labelled else label
    axes.plot(across, [cell.paper] * 2, color="black", linewidth=1.8, zorder=5, label=shown, path_effects=strokes)
    labelled.add(label)
