"""``fogwatch key``: the key of a fleet. Raises BadInput; the caller prints it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fogwatch.cli.command_help import command
from patrol.printable import printable
from patrol.radio.fleet_key import new_key

app = typer.Typer(help="Make a key that authenticates a fleet's messages.", no_args_is_help=True)


@app.callback()
def _group() -> None:
    """Keep the name of the only command."""


@command(app, examples=["fogwatch key new fleet.key"])
def new(path: Annotated[Path, typer.Argument(metavar="FILE", help="File to write; it must not exist yet.")]) -> None:
    """Write a new random key to a file that only its owner can read.

    Give each robot a copy, and name the file in the scenario: radio: {key: FILE}.
    """
    new_key(path)
    typer.echo(printable(f"{path}: new key written; name the file in the scenario as radio.key"))
