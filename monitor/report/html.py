"""The few pieces of HTML that a report is made of. Everything that is text is escaped here and nowhere else."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from importlib.resources import files

from monitor.report.style import Drawing


class Markup(str):
    """Text that is HTML already and is not escaped again; only this module makes any."""

    __slots__ = ()


POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
"""What a page may load: nothing that is not in it."""


def page(title: str, body: Iterable[str]) -> str:
    """A whole document, style included."""
    style = files("monitor.report").joinpath("report.css").read_text(encoding="utf-8")
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>\n{style}</style>\n</head>\n<body>\n<main>\n"
        + "\n".join(body)
        + "\n</main>\n</body>\n</html>\n"
    )


def section(name: str, heading: str, *content: str) -> str:
    """A part of the page that a link can lead to; nothing when it would be empty."""
    inside = "\n".join(part for part in content if part)
    return f'<section id="{escape(name)}">\n<h2>{escape(heading)}</h2>\n{inside}\n</section>' if inside else ""


def heading(title: str, mark: Markup | None = None) -> str:
    """The page's title, after a badge if there is one."""
    return f"<h1>{f'{mark} ' if mark else ''}{escape(title)}</h1>"


def text(says: str, kind: str = "") -> str:
    """A paragraph, or nothing."""
    return f"<p{_class(kind)}>{escape(says)}</p>" if says else ""


def banner(says: str, bad: bool = False) -> str:
    """Something to know before anything else, or nothing."""
    return f'<div class="banner{" bad" if bad else ""}">{escape(says)}</div>' if says else ""


def badge(word: str, kind: str) -> Markup:
    """A word in a frame."""
    return Markup(f'<span class="badge {escape(kind)}">{escape(word)}</span>')


def boxes(items: Iterable[tuple[str, str, str]]) -> str:
    """(value, name, note) each in a box."""
    boxes = "".join(
        f'<div class="tile"><b>{escape(value)}</b>{escape(name)}<span>{escape(note)}</span></div>'
        for value, name, note in items
    )
    return f'<div class="tiles">{boxes}</div>'


def table(heads: Sequence[str], rows: Iterable[Sequence[str]], numbers: Sequence[int] = ()) -> str:
    """A table of text; numbers: the columns set to the right. A cell that `badge` made stays as it is."""

    def cell(tag: str, column: int, says: str) -> str:
        inside = says if isinstance(says, Markup) else escape(says)
        return f"<{tag}{_class('n' if column in numbers else '')}>{inside}</{tag}>"

    def row(tag: str, cells: Sequence[str]) -> str:
        return f"<tr>{''.join(cell(tag, column, says) for column, says in enumerate(cells))}</tr>"

    body = "\n".join(row("td", cells) for cells in rows)
    head = row("th", heads)
    return f'<div class="scroll"><table>\n<thead>{head}</thead>\n<tbody>\n{body}\n</tbody>\n</table></div>'


def details(summary: str, *content: str) -> str:
    """What is shown when asked for."""
    inside = "\n".join(content)
    return f"<details><summary>{escape(summary)}</summary>\n{inside}\n</details>"


def preformatted(says: str) -> str:
    """Text as it is."""
    return f"<pre>{escape(says)}</pre>"


def figure(drawing: Drawing | None, heading: bool = False) -> str:
    """A figure with its caption."""
    if drawing is None:
        return ""
    above = f"<b>{escape(drawing.heading)}.</b> " if heading else ""
    return f"<figure>\n{drawing.page_svg()}\n<figcaption>{above}{escape(drawing.caption)}</figcaption>\n</figure>"


def side_by_side(*content: str) -> str:
    """Next to each other where there is room."""
    inside = "".join(content)
    return f'<div class="pair">{inside}</div>' if inside else ""


def navigation(items: Iterable[tuple[str, str]]) -> str:
    """(target, text): places on the page, or files beside it."""
    return f"<nav>{' '.join(f'<a href={chr(34)}{escape(to)}{chr(34)}>{escape(says)}</a>' for to, says in items)}</nav>"


def _class(kind: str) -> str:
    return f' class="{escape(kind)}"' if kind else ""
