"""The page of a study in Markdown: the command that made it, its tables, and its figures, beside the results."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from rich.console import Console
from rich.markdown import Markdown

from experiments.sweeps.cases import write_text
from experiments.sweeps.progress import command_line
from experiments.sweeps.runner import SweepOutcome
from monitor.figures.style import Drawing
from runtime.process.aside import in_two

FIGURE = re.compile(r"(table-\d-)?((cases|change|curves)-[a-z0-9_]+|plane|plane-gain)\.(png|svg|pdf)")
"""File names of the figures of studies."""


def page_head(title: str, outcome: SweepOutcome, *command: str) -> Iterator[str]:
    """Yield the beginning of a page: its title, and how its numbers were made; `command` has the command's words."""
    yield f"# {title}"
    minutes = f"{outcome.computing_s / 60.0:.0f} min of computing on one core"
    yield f"    {command_line(*command)}        # {len(outcome.plan.runs)} runs, {minutes}"
    if outcome.failed:
        yield f"**{len(outcome.failed)} runs failed or were not valid; they are left out.**"


def print_page(console: Console, parts: Sequence[str]) -> None:
    """Print parts of a page, on a terminal without the marks of Markdown."""
    text = "\n\n".join(parts)
    if console.is_terminal:
        console.print(Markdown(text))
    else:
        console.print(text, highlight=False, markup=False, soft_wrap=True)


def write_page(file: Path, parts: Sequence[str], drawings: Sequence[Drawing]) -> None:
    """Write a page, and its figures into the folder figures beside it.

    Figures of an earlier plan that this one no longer has are removed.
    """
    folder = file.parent / "figures"
    saved = in_two(lambda drawing: drawing.save(folder), drawings)
    written = {picture for pictures in saved for picture in pictures}
    for picture in folder.glob("*"):
        if picture not in written and FIGURE.fullmatch(picture.name):
            picture.unlink()
    figures = (
        f"## {shown.heading}\n\n![{shown.heading}](figures/{shown.name}.png)\n\n{shown.caption}" for shown in drawings
    )
    write_text(file, "\n\n".join([*parts, *figures]) + "\n")
