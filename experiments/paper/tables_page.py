"""The paper's tables as one Markdown page: our values beside the printed ones, what differs and why, the conclusions.

The page links the pictures by the file names that it is given.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from experiments.paper.orderings import Judged
from experiments.paper.printed import paper
from experiments.paper.tables import FAR_OFF, Cell, PaperSetup, TableComparison, fit_texts, fits_of, to_mean_fog_text
from experiments.sweeps.stats import Estimate, with_interval
from monitor.tables.table import Table
from patrol.errors import quoted

UNEXPLAINED = "not explained"

CELLS = (
    "MFoW is a maximum, so it depends on the size of the points: compare only runs with the same size. Each cell "
    "shows our mean over the seeds ± half the width of its 95 % interval, the printed value in brackets, and the ratio "
    "of the two. Where the paper leaves something open, the table lists what is assumed. Values that differ by more "
    f"than a factor of {FAR_OFF:g} are bold, and listed below with the reason where it is known."
)


def page(
    comparisons: Sequence[TableComparison],
    judged: Sequence[Judged],
    setup: PaperSetup,
    *,
    command: str,
    computing_s: float,
    pictures: Mapping[str, str],
) -> str:
    """Return the page as Markdown.

    `computing_s` is the processor time of all runs together; for results of older versions, which lack it, the wall
    time. `pictures` are the files of the pictures by title, those of terrains included.
    """
    parts = [
        *_page_head(setup, command, computing_s),
        *_terrain_section(pictures),
        *_fit_section(comparisons),
        *(part for comparison in comparisons for part in _table_section(comparison, pictures)),
        *_far_off(comparisons),
        *_ordering_section(judged),
    ]
    return "\n\n".join(parts) + "\n"


def _page_head(setup: PaperSetup, command: str, computing_s: float) -> Iterator[str]:
    calibrated = paper().sensor_range(setup.point)
    yield "# The paper's tables, side by side"
    yield f"Made by `{command}`: {_minutes_text(computing_s)} of computing time on one core."
    radius = f"sensor range {setup.sensor_range:g} m"
    if (setup.sensor_range, setup.point) == (calibrated.range, calibrated.point):
        radius += f" ({calibrated.found})"
    fixed = (f"`{field}: {quoted(value)}`" for field, value in paper().settings.items() if field not in setup.settings)
    yield "\n".join(
        (
            f"Points of {setup.point:g} m, {radius}, seeds {', '.join(map(str, setup.seeds))}.",
            f"All cells share these settings of the paper: {', '.join(fixed)}.",
            *(f"Set in addition: `{field}: {quoted(value)}`." for field, value in setup.settings.items()),
            CELLS,
        )
    )


def _terrain_section(pictures: Mapping[str, str]) -> Iterator[str]:
    drawn = [f"![{title}]({file})" for title, file in pictures.items() if title.startswith("terrain ")]
    if drawn:
        yield "## The terrains"
        yield (
            "The paper's figures of the terrains are not available. These are reconstructions from the sizes and the "
            "short descriptions in the text. The length of the wedges of `yards` was fitted to the one-robot cell of "
            "Table 4 (wave, mode), with an earlier version of the algorithm. Nothing else is fitted, so all other "
            "cells are predictions."
        )
        yield "\n".join(drawn)


def _fit_section(comparisons: Sequence[TableComparison]) -> Iterator[str]:
    """Yield a table that says how well each table fits."""
    heads = ("MFoW of", "cells", "median ratio", "RMS log error", "correlation of logs")
    yield "## Fit"
    rows = [[name, str(fit.cells), *fit_texts(fit)] for name, fit in fits_of(comparisons)]
    yield Table(heads, rows).markdown()


def _table_section(comparison: TableComparison, pictures: Mapping[str, str]) -> Iterator[str]:
    table = comparison.table
    yield f"## Table {table.number}: {table.title}"
    yield f"Assumed: {'; '.join(table.assumed)}."
    rows = [
        [f"{row} ({unit})", *(_cell_text(cell) for cell in comparison.cells if cell.row == row)]
        for row, unit in dict.fromkeys((cell.row, cell.unit) for cell in comparison.cells)
    ]
    yield Table([table.columns_are, *(column.name for column in table.columns)], rows).markdown()
    if ratios := to_mean_fog_text(comparison):
        yield f"{ratios}."
    if picture := pictures.get(f"table {table.number}"):
        yield f"![Table {table.number}]({picture})"


def _cell_text(cell: Cell) -> str:
    text = with_interval(cell.found, sign=" ± ", none="no run")
    if cell.paper is not None:
        text += f" ({cell.paper:g})"
    if cell.ratio is not None:
        text += f" **x {cell.ratio:.2f}**" if cell.far_off else f" x {cell.ratio:.2f}"
    return text


def _far_off(comparisons: Sequence[TableComparison]) -> Iterator[str]:
    """Yield every far-off cell under the remark about it."""
    by_remark: dict[str, list[str]] = {}
    for comparison in comparisons:
        number = comparison.table.number
        for cell in comparison.cells:
            if cell.far_off:
                remarks = (remark for remark in paper().remarks if remark.applies_to(number, cell.row, cell.column))
                remark = next(remarks, None)
                name = f"Table {number} {cell.row}, {comparison.table.columns_are} {cell.column} (x {cell.ratio:.2f})"
                by_remark.setdefault(remark.says if remark else UNEXPLAINED, []).append(name)
    total = sum(cell.ratio is not None for comparison in comparisons for cell in comparison.cells)
    yield f"## Cells that differ by more than a factor of {FAR_OFF:g}"
    yield f"{sum(map(len, by_remark.values()))} of {total} cells."
    for reason, names in by_remark.items():
        yield f"- {reason}: {'; '.join(names)}."


def _ordering_section(judged: Sequence[Judged]) -> Iterator[str]:
    if not judged:
        return
    yield "## The paper's conclusions"
    yield (
        "The ratio divides the side that should be lower by the other side; it is a geometric mean over the cells "
        "named and the seeds. Held: its 95 % interval lies below 1. Not held: it lies above 1."
    )
    rows = [[judgement.ordering.says, judgement.verdict, _ratio_text(judgement.ratio)] for judgement in judged]
    yield Table(("conclusion", "here", "ratio, 95 % interval"), rows).markdown()


def _ratio_text(ratio: Estimate | None) -> str:
    if ratio is None:
        return "-"
    return f"{ratio.mean:.3f}" + ("" if ratio.interval is None else f" [{ratio.low:.3f}, {ratio.high:.3f}]")


def _minutes_text(seconds: float) -> str:
    return f"{seconds / 60.0:.0f} min" if seconds >= 90.0 else f"{seconds:.0f} s"
