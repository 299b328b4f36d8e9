"""Opening the folder of a run for the commands that look at it, whether the run has ended or not."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fogwatch.cli.options import option
from fogwatch.run_folder.reading import read_folder
from patrol.errors import printable

if TYPE_CHECKING:
    from monitor.replay.run import Run

RunFolder = Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a run.")]
Key = Annotated[
    Path | None,
    option("FILE", "Key of the run's fleet, to check the tags of its messages (default: unchecked).", "--key"),
]
"""The file that a run's scenario names is not opened: the run may be a stranger's."""


def open_folder(folder: Path, key: Path | None = None) -> tuple[Run, bool]:
    """Open a run's folder, after compiling the kernels that this needs.

    Return the run, and whether it may still be going on. Without the file `key`, the tags of messages stay unchecked.
    """
    return read_folder(folder, key, lambda line: typer.echo(line, err=True))


def print_state(run: Run, going: bool) -> None:
    """Print on the standard error what a run's folder lacks, and where its summary disagrees with its journal."""
    from monitor.report.analysis import disagreement, state_of

    for why in (state_of(run, going)[1], disagreement(run)):
        if why:
            typer.echo(printable(f"{run.folder}: {why}"), err=True)
