"""Tables of text as Markdown, for the pages of results, and as LaTeX, for papers."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence

_LATEX = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "±": r"$\pm$",
    "²": r"\textsuperscript{2}",
    "<": "$<$",
    ">": "$>$",
    **{character: rf"\{character}" for character in "&%$#_{}"},
}
"""What stands for a character that LaTeX does not print as it is."""


def markdown_table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield the lines of a table in Markdown."""
    yield f"| {' | '.join(heads)} |"
    yield "|---" * len(heads) + "|"
    yield from (f"| {' | '.join(row)} |" for row in rows)


def latex_table(
    heads: Sequence[str], rows: Sequence[Sequence[str]], numbers: Collection[int] = (), notes: Sequence[str] = ()
) -> str:
    """Return a table for LaTeX with the package booktabs: a tabular, to be put into a table with a caption.

    `numbers` are the indices of the columns that are aligned at the right, `notes` lines that stand above it as
    comments.
    """
    places = "".join("r" if place in numbers else "l" for place in range(len(heads)))
    lines = [
        *(f"% {note}" for note in notes),
        r"% \usepackage{booktabs}",
        rf"\begin{{tabular}}{{{places}}}",
        r"\toprule",
        _latex_row(heads),
        r"\midrule",
        *map(_latex_row, rows),
        r"\bottomrule",
        r"\end{tabular}",
    ]
    return "\n".join([*lines, ""])


def _latex_row(cells: Sequence[str]) -> str:
    return rf"{' & '.join(map(_latex_text, cells))} \\"


def _latex_text(text: str) -> str:
    """Escape a cell; the hyphen of a negative number becomes a minus sign."""
    escaped = "".join(_LATEX.get(character, character) for character in text)
    return re.sub(r"(?<![\w-])-(?=\d)", "$-$", escaped)
