"""The HTML elements of a report. All text is escaped here, and nowhere else."""

from __future__ import annotations

import html
from collections.abc import Collection, Iterable, Sequence
from importlib.resources import files

from monitor.figures.style import Drawing
from patrol import palette
from patrol.errors import printable_lines


class Markup(str):
    """HTML, which is not escaped again; created only in this module."""

    __slots__ = ()


POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
"""Content security policy: a report loads nothing."""


def escape(says: str) -> str:
    """Escape text that others may have written, characters included that would reverse or hide what follows."""
    return html.escape(printable_lines(says))


def page(title: str, body: Iterable[str]) -> str:
    """Return a complete document with its style."""
    style = palette.css() + files("monitor.report").joinpath("report.css").read_text(encoding="utf-8")
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>\n{style}</style>\n</head>\n<body>\n<main>\n"
        + "\n".join(body)
        + "\n</main>\n</body>\n</html>\n"
    )


def section(name: str, heading: str, *content: str) -> str:
    """Return a section with the id `name`, the target of links; empty without content."""
    inside = "\n".join(part for part in content if part)
    return f'<section id="{escape(name)}">\n<h2>{escape(heading)}</h2>\n{inside}\n</section>' if inside else ""


def main_heading(title: str, mark: Markup | None = None) -> str:
    """Return the heading of the document."""
    return f"<h1>{f'{mark} ' if mark else ''}{escape(title)}</h1>"


def text(says: str, kind: str = "") -> str:
    """Return a paragraph of the CSS class `kind`; empty without text."""
    return f"<p{_class_attribute(kind)}>{escape(says)}</p>" if says else ""


def banner(says: str, bad: bool = False) -> str:
    """Return a highlighted message; empty without text."""
    return f'<div class="banner{" bad" if bad else ""}">{escape(says)}</div>' if says else ""


def badge(word: str, kind: str) -> Markup:
    """Return a word in a frame of the CSS class `kind`."""
    return Markup(f'<span class="badge {escape(kind)}">{escape(word)}</span>')


def boxes(items: Iterable[tuple[str, str, str]]) -> str:
    """Return boxes with (value, name, note) each."""
    inside = "".join(
        f'<div class="tile"><b>{escape(value)}</b>{escape(name)}<span>{escape(note)}</span></div>'
        for value, name, note in items
    )
    return f'<div class="tiles">{inside}</div>'


def table(heads: Sequence[str], rows: Iterable[Sequence[str]], numbers: Collection[int] = ()) -> str:
    """Return a table, empty without rows; cells that are `Markup` are not escaped.

    `numbers` are the indices of the columns to align to the right.
    """

    def cell(tag: str, column: int, says: str) -> str:
        inside = says if isinstance(says, Markup) else escape(says)
        head = f' data-head="{escape(heads[column])}"' if tag == "td" else ""  # a phone shows it beside each cell
        return f"<{tag}{_class_attribute('n' if column in numbers else '')}{head}>{inside}</{tag}>"

    def row(tag: str, cells: Sequence[str]) -> str:
        return f"<tr>{''.join(cell(tag, column, says) for column, says in enumerate(cells))}</tr>"

    body, head = "\n".join(row("td", cells) for cells in rows), row("th", heads)
    table = f'<div class="scroll"><table>\n<thead>{head}</thead>\n<tbody>\n{body}\n</tbody>\n</table></div>'
    return table if body else ""


def long_table(
    summary: str, heads: Sequence[str], rows: Sequence[Sequence[str]], numbers: Collection[int], most: int
) -> str:
    """Return a table that is hidden until the summary is clicked.

    Of its rows, the first `most` are shown; the number of the others is given below.
    """
    left_out = f"{len(rows) - most} more are not listed" if len(rows) > most else ""
    return details(summary, table(heads, rows[:most], numbers), text(left_out, "note"))


def details(summary: str, *content: str) -> str:
    """Return content that is hidden until the summary is clicked."""
    inside = "\n".join(content)
    return f"<details><summary>{escape(summary)}</summary>\n{inside}\n</details>"


def preformatted(says: str) -> str:
    """Return preformatted text."""
    return f"<pre>{escape(says)}</pre>"


def figure(drawing: Drawing | None, heading: bool = False) -> str:
    """Return a figure with its caption; empty without a drawing."""
    if drawing is None:
        return ""
    above = f"<b>{escape(drawing.heading)}.</b> " if heading else ""
    return f"<figure>\n{drawing.page_svg}\n<figcaption>{above}{escape(drawing.caption)}</figcaption>\n</figure>"


def side_by_side(*content: str) -> str:
    """Put elements next to each other if there is enough room."""
    inside = "".join(content)
    return f'<div class="pair">{inside}</div>' if inside else ""


def navigation(items: Iterable[tuple[str, str]]) -> str:
    """Return links: (target, text), with places on the page or files as targets."""
    return f"<nav>{' '.join(f'<a href={chr(34)}{escape(to)}{chr(34)}>{escape(says)}</a>' for to, says in items)}</nav>"


def _class_attribute(kind: str) -> str:
    return f' class="{escape(kind)}"' if kind else ""
