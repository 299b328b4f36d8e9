"""``fogwatch reproduce``: make figures of the documentation again, and check its numbers.

Raises BadInput; the caller prints it.
"""

from __future__ import annotations

import json
import os
import shlex
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

import fogwatch
from experiments.commands.documented import read_samples
from fogwatch.cli.command_help import command, group
from fogwatch.cli.options import option
from patrol.errors import BadInput, did_you_mean

DIFFERS = 1

CLONE = Path(fogwatch.__file__).parents[1]
"""Where scripts of the documentation are, in a clone."""


def site_figures() -> dict[str, dict[str, Any]]:
    """Return the figures of the documentation that a command makes, by name.

    Each has ``files``, patterns of its pictures in the folder docs, ``command``, without the folder that it writes to,
    and ``minutes`` of computing on one core, as figures.json lists them.
    """
    listed = json.loads(Path(__file__).with_name("figures.json").read_text(encoding="utf-8"))
    return {row["figure"]: row for row in listed}


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
        for figure in figures.values():
            typer.echo(f"{figure['figure']}: {figure['minutes']} min: {figure['command']}")
        return 0
    if name not in figures:
        raise BadInput(f"{name}: no such figure; {did_you_mean(name, list(figures))}")
    line, folder = figures[name]["command"], (out or Path("runs") / name).absolute()
    program, *arguments = shlex.split(line)
    for place, word in enumerate(arguments):
        if "/" in word:  # a file of a clone
            if not (CLONE / word).is_file():
                raise BadInput(f"{name}: needs {word}, which only a clone has; run the command in a clone")
            arguments[place] = str(CLONE / word)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"--out {folder}: {error.strerror}; choose another folder") from None
    words = [sys.executable, *(("-P", "-m", "fogwatch") if program == "fogwatch" else ()), *arguments]
    if program == "python":
        os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [str(CLONE), os.environ.get("PYTHONPATH")]))
    typer.echo(f"{line}: takes about {figures[name]['minutes']} min of computing on one core")
    sys.stdout.flush()
    os.execv(words[0], [*words, "--out", str(folder)])  # so that signals and exit code are the command's own
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
