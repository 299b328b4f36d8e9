"""``fogwatch reproduce``: make figures of the documentation again, and check its numbers.

Raises BadInput; the caller prints it.
"""

from __future__ import annotations

import json
import os
import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer
from rich.console import Console
from rich.table import Table
from typer.core import TyperGroup

import fogwatch
from experiments.commands.documented import read_samples
from fogwatch.cli.command_help import command, group
from fogwatch.cli.options import option
from patrol.errors import BadInput, did_you_mean, printable

DIFFERS = 1

CLONE = Path(fogwatch.__file__).parents[1]
"""Where scripts of the documentation are, in a clone."""


@dataclass(frozen=True, slots=True)
class SiteFigure:
    """A figure of the documentation, or several that one command makes."""

    figure: str
    files: tuple[str, ...]  # patterns of its pictures in the folder docs
    command: str  # without the folder that it writes to
    minutes: int  # of computing on one core

    def words(self, out: Path) -> list[str]:
        """Return the command with the program that runs it and its folder."""
        program, *arguments = shlex.split(self.command)
        if program == "fogwatch":
            return [sys.executable, "-P", "-m", "fogwatch", *arguments, "--out", str(out)]
        script = CLONE / arguments[0]
        if not script.is_file():
            raise BadInput(f"{self.figure}: needs {arguments[0]}, which only a clone has; run the command in a clone")
        return [sys.executable, str(script), *arguments[1:], "--out", str(out.absolute())]


def site_figures() -> list[SiteFigure]:
    """Return the figures of the documentation that a command makes, as figures.json lists them."""
    listed = json.loads(Path(__file__).with_name("figures.json").read_text(encoding="utf-8"))
    return [SiteFigure(row["figure"], tuple(row["files"]), row["command"], row["minutes"]) for row in listed]


class _Reproduce(TyperGroup):
    """Commands that reproduce numbers and pictures; words that name none of them are those of ``figure``."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Add the word ``figure``, so that ``fogwatch reproduce rules`` makes that figure, and no word lists them."""
        if not ctx.resilient_parsing and (not args or args[0] not in (*self.commands, "--help")):
            args = ["figure", *args]
        return super().parse_args(ctx, args)


app = group(
    "reproduce",
    "Reproduce the figures and numbers of the documentation, and the paper's tables. `fogwatch reproduce "
    "NAME` makes a figure, `fogwatch reproduce` lists them.",
    _Reproduce,
)


@command(
    app,
    examples=[
        "fogwatch reproduce figure paper-table-2 --out table-2",
        "fogwatch reproduce rules",
        "fogwatch reproduce",
    ],
    exit_codes="0 done, 1 some runs failed, 2 bad input, 130 interrupted",
)
def figure(
    name: Annotated[str | None, typer.Argument(metavar="FIGURE", help="Its name; without one, all are listed.")] = None,
    out: Annotated[Path | None, option("FOLDER", "Folder of the pictures (default: runs/FIGURE).")] = None,
) -> int:
    """Make a figure of the documentation again, from the command that made it; without a name, list the figures.

    Long measurements go on where they were interrupted.
    """
    figures = site_figures()
    if name is None:
        if out is not None:
            raise BadInput(f"--out {out}: nothing is made without a FIGURE; name one")
        _list_figures(figures)
        return 0
    if name not in (names := [entry.figure for entry in figures]):
        raise BadInput(f"{name}: no such figure; {did_you_mean(name, names)}")
    _become_command(figures[names.index(name)], out or Path("runs") / name)
    return None


@command(
    app,
    examples=["fogwatch reproduce check", "fogwatch reproduce check radio"],
    exit_codes="0 done, 1 some number differs, 2 bad input, 130 interrupted",
)
def check(
    page: Annotated[
        str | None, typer.Argument(metavar="PAGE", help="A page of docs/results; without one, all are checked.")
    ] = None,
) -> int:
    """Measure a sample of the numbers in docs/results again, and name those that have changed.

    Numbers that were measured with an earlier version can differ. A number has changed if it differs by more than its
    interval on the page, or by more than a tenth where the page gives none.
    """
    documented = read_samples(CLONE)
    pages = list(dict.fromkeys(sample.page for sample in documented.samples))
    if page is not None and page not in pages:
        reason = documented.unsampled.get(page)
        raise BadInput(
            f"{page}: {f'has no sample: {reason}' if reason else f'no such page; {did_you_mean(page, pages)}'}"
        )
    changed = 0
    samples = [sample for sample in documented.samples if page in (None, sample.page)]
    for sample in samples:
        recorded, allowed = sample.stated(documented.folder)
        typer.echo(f"docs/results/{sample.page}.md ...", err=True)
        value = sample.measure(CLONE)
        same = abs(value - recorded) <= allowed
        changed += not same
        typer.echo(
            f"{'same   ' if same else 'changed'} docs/results/{sample.page}.md: {recorded:g} (within "
            f"{allowed:.3g}), now {value:.4g}: "
            f"{sample.commands[-1].format(out='OUT', seed=sample.seeds[-1], clone='.')}"
        )
    typer.echo(f"{changed} of {len(samples)} numbers have changed")
    return DIFFERS if changed else 0


def _become_command(figure: SiteFigure, folder: Path) -> NoReturn:
    """Say what is made, and go on as the command that makes it, so that its signals and exit code are its own."""
    words = figure.words(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"--out {folder}: {error.strerror}; choose another folder") from None
    typer.echo(printable(f"{figure.command} --out {shlex.quote(str(folder))}"))
    typer.echo(f"takes about {_minutes_text(figure.minutes)} of computing on one core")
    typer.echo(printable(f"beside it: {', '.join(f'docs/{file}' for file in figure.files)}"))
    sys.stdout.flush()
    if not figure.command.startswith("fogwatch "):  # a script of a clone
        os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [str(CLONE), os.environ.get("PYTHONPATH")]))
    os.execv(words[0], words)


def _list_figures(figures: Sequence[SiteFigure]) -> None:
    """Print the figures: as a table on a terminal, elsewhere a line each."""
    console = Console()
    if not console.is_terminal:
        for figure in figures:
            typer.echo(f"{figure.figure}: {_minutes_text(figure.minutes)}: {figure.command}")
        return
    table = Table("figure", "computing", "command", box=None, header_style="cyan")
    for figure in figures:
        table.add_row(figure.figure, _minutes_text(figure.minutes), figure.command)
    console.print(table, highlight=False, markup=False)


def _minutes_text(minutes: int) -> str:
    """Return a time as text."""
    return f"{minutes} min" if minutes < 100 else f"{minutes / 60:.1f} h"
