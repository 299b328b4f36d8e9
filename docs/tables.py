"""Write generated tables of the documentation again: ``make tables``.

Those of metrics in docs/run-folder.md, and those of columns in docs/python-api.md, from their declarations.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

from monitor.tables.columns import TABLES, TableColumns
from patrol.summary.metric import metrics_of
from patrol.summary.model import Messages, NodeFigures, RobotFigures, Summary, ZoneFigures

if TYPE_CHECKING:
    from pydantic import BaseModel

DOCUMENTS = tuple(Path(__file__).parent / name for name in ("run-folder.md", "python-api.md"))
MODELS: Mapping[str, type[BaseModel]] = {
    "summary": Summary,
    "nodes": NodeFigures,
    "zones": ZoneFigures,
    "messages": Messages,
    "robots": RobotFigures,
}


ARROWS = {"": "", "lower": " ↓", "higher": " ↑"}
"""Marks of what is better, which the page explains once."""

SHARED = TABLES["ticks"].columns[:2]
"""Columns that most tables begin with, which the page explains once."""


def table(model: type[BaseModel]) -> str:
    """Return the table of a model's metrics, as Markdown."""
    rows = [f"| `{key}` | {metric.meaning}{ARROWS[metric.better]} |\n" for key, metric in metrics_of(model)]
    return "".join(("| field | is |\n", "|---|---|\n", *rows))


def columns_table(declared: TableColumns) -> str:
    """Return the table of a table's columns, as Markdown."""
    own = (column for column in declared.columns if column not in SHARED)
    rows = [
        f"| {', '.join(f'`{column.name}`' for column in alike)} | {meaning} |\n"
        for meaning, alike in groupby(own, key=lambda column: column.meaning)
    ]
    return "".join(("| column | is |\n", "|---|---|\n", *rows))


def with_tables(document: str) -> str:
    """Return the document with a table below each line ``<!-- metrics: NAME -->`` and ``<!-- columns: NAME -->``."""

    def made(match: re.Match[str]) -> str:
        name = match[3]
        return f"{match[1]}{table(MODELS[name]) if match[2] == 'metrics' else columns_table(TABLES[name])}\n"

    return re.sub(r"(<!-- (metrics|columns): (\w+) -->\n\n)(?:\|.*\n)*\n?", made, document)


if __name__ == "__main__":
    for document in DOCUMENTS:
        document.write_text(with_tables(document.read_text(encoding="utf-8")), encoding="utf-8")
