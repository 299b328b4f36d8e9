"""Write the tables of docs/run-folder.md again, from the declarations of the metrics: ``make tables``."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from patrol.summary.metric import metrics_of
from patrol.summary.model import Messages, NodeFigures, RobotFigures, Summary, ZoneFigures

if TYPE_CHECKING:
    from pydantic import BaseModel

DOCUMENT = Path(__file__).parent / "run-folder.md"
MODELS: Mapping[str, type[BaseModel]] = {
    "summary": Summary,
    "nodes": NodeFigures,
    "zones": ZoneFigures,
    "messages": Messages,
    "robots": RobotFigures,
}


def table(model: type[BaseModel]) -> str:
    """Return the table of a model's metrics, as Markdown."""
    rows = [
        f"| `{key}` | {metric.meaning}{f'; {metric.better} is better' if metric.better else ''} |\n"
        for key, metric in metrics_of(model)
    ]
    return "".join(("| field | is |\n", "|---|---|\n", *rows))


def with_tables(document: str) -> str:
    """Return the document with the table of a model below each line ``<!-- metrics: NAME -->``."""
    return re.sub(
        r"(<!-- metrics: (\w+) -->\n\n)(?:\|.*\n)*\n?", lambda match: f"{match[1]}{table(MODELS[match[2]])}\n", document
    )


if __name__ == "__main__":
    DOCUMENT.write_text(with_tables(DOCUMENT.read_text(encoding="utf-8")), encoding="utf-8")
