"""Results as notebooks show them: small HTML fragments, which bring no style. All text is escaped here."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

from PIL import Image

from monitor.tables.table import Table
from patrol.files.untrusted import PICTURE, leads_out, read_untrusted
from patrol.summary.metric import metrics_of
from patrol.summary.model import Summary

WIDTH = 640
"""Largest width and height of a picture, pixels."""
MOST_PIXELS = 64_000_000
"""Pixels of the largest picture that is made smaller; those of fogwatch have fewer."""
MOST_WARNINGS = 5
MOST_ROWS = 40


def table_html(table: Table) -> str:
    """Return an HTML table; of a long one, only the first rows."""

    def row(tag: str, cells: Sequence[str]) -> str:
        return f"<tr>{''.join(f'<{tag}>{escape(cell)}</{tag}>' for cell in cells)}</tr>"

    body = "".join(row("td", cells) for cells in table.rows[:MOST_ROWS])
    hidden = len(table.rows) - MOST_ROWS
    note = f"<p>... and {hidden} more rows</p>" if hidden > 0 else ""
    return f"<table><thead>{row('th', table.heads)}</thead><tbody>{body}</tbody></table>{note}"


def lines_html(lines: Iterable[str]) -> str:
    """Return lines of text, one below the other."""
    return "".join(f"<div>{escape(line)}</div>" for line in lines)


def run_html(summary: Summary, folder: Path, announced: Iterable[str] = ()) -> str:
    """Return as HTML what a run announced, its main figures, its verdict, and its final fog if fog.png shows it.

    The folder may be a stranger's.
    """
    verdict = summary.verdict
    outcome = "not judged" if verdict is None else f"verdict {verdict.outcome}"
    warnings = [] if verdict is None else verdict.warnings
    rows = [(metric.title, metric.text(getattr(summary, key))) for key, metric in metrics_of(Summary) if metric.title]
    messages = summary.messages
    rows.append(("frames delivered", f"{messages.delivered} of {messages.sent}"))
    rows.append(("robots", ", ".join(f"{name} {robot.status}" for name, robot in summary.robots.items())))
    hidden = len(warnings) - MOST_WARNINGS
    lines = [f"warning: {line}" for line in warnings[:MOST_WARNINGS]]
    return "".join(
        (
            f"<div><b>{escape(summary.name)}</b>: {summary.simulated_s:g} s simulated, {escape(outcome)}</div>",
            lines_html(announced),
            table_html(Table(("figure", "value"), rows)),
            lines_html([*lines, *([f"{hidden} more warnings"] if hidden > 0 else [])]),
            _picture_element(folder),
            f"<div><code>{escape(str(folder))}</code></div>",
        )
    )


def _picture_element(folder: Path) -> str:
    """Return fog.png, made smaller, as an element of the page; nothing where there is none that can be shown."""
    file = folder / "fog.png"
    if not file.is_file() or leads_out(folder, file):
        return ""
    small = io.BytesIO()
    try:
        with Image.open(io.BytesIO(read_untrusted(file, PICTURE)), formats=["PNG"]) as image:
            if image.width * image.height > MOST_PIXELS:
                return ""
            image.thumbnail((WIDTH, WIDTH))
            image.save(small, format="PNG")
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError):  # no PNG, or a broken one
        return ""
    data = base64.b64encode(small.getvalue()).decode("ascii")
    return f'<img alt="the fog at the end, and the robots&#x27; paths" src="data:image/png;base64,{data}">'
