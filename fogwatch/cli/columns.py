"""Rows of text, aligned in columns, within the width of a terminal."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.measure import Measurement
from rich.table import Table

from monitor.tables.table import Table as Shown

WIDEST = 24
"""Width of a column at most, so that one long value does not part the columns."""

UNLIMITED = 100_000
"""Width of a terminal on which nothing is wrapped."""


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return a line for each row, with columns as wide as their longest cell."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]


def drawn(shown: Shown) -> Table:
    """Return a table of texts as a terminal shows it."""
    table = Table(box=None, pad_edge=False, header_style="cyan")
    for column, head in enumerate(shown.heads):
        table.add_column(head, justify="right" if column in shown.numbers else "left")
    for row in shown.rows:
        table.add_row(*row)
    return table


def fits(table: Table, console: Console) -> bool:
    """Return True if no cell of a table has to be wrapped or cut."""
    return Measurement.get(console, console.options.update(width=UNLIMITED), table).maximum <= console.width


def print_side_by_side(
    console: Console, names: Sequence[str], tables: Sequence[tuple[str, Sequence[Sequence[str]]]]
) -> None:
    """Print tables with a column for each name: as many columns as fit, the others below them.

    A table is a heading and rows, each a label and then a cell for each name. Names that are wider than their columns
    are printed above the tables, which then have their numbers.
    """
    wide = min(max((len(cell) for _, rows in tables for row in rows for cell in row[1:]), default=0), WIDEST)
    heads = list(names)
    if max(map(len, names)) > wide and not fits(_side_by_side(tables, heads, range(len(heads))), console):
        heads = [str(number) for number in range(1, len(names) + 1)]
        for head, name in zip(heads, names, strict=True):
            console.print(f"{head}: {name}", highlight=False, markup=False, soft_wrap=True)
    first = 0
    while first < len(heads):
        last = first + 1
        while last < len(heads) and fits(_side_by_side(tables, heads, range(first, last + 1)), console):
            last += 1
        if first:
            console.print()
        console.print(_side_by_side(tables, heads, range(first, last)), highlight=False, markup=False)
        first = last


def _side_by_side(tables: Sequence[tuple[str, Sequence[Sequence[str]]]], heads: Sequence[str], shown: range) -> Table:
    """Return the tables below each other, with the columns of some of the names."""
    table = Table("", box=None, padding=(0, 2, 0, 0), header_style="bold")
    for column in shown:
        table.add_column(heads[column], justify="right", overflow="fold", max_width=WIDEST)
    for heading, rows in tables:
        if heading and rows:
            table.add_row()
            table.add_row(heading, style="bold")
        for label, *cells in rows:
            table.add_row(label, *(cells[column] for column in shown))
    return table
