"""``fogwatch key``: the fleet's key. Raises BadInput; the caller prints it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from patrol.radio.fleet_key import new_key

app = typer.Typer(help="Make the key that tags a fleet's messages.", no_args_is_help=True)


@app.callback()
def _group() -> None:
    """Keep the name of the only command."""


@app.command()
def new(path: Annotated[Path, typer.Argument(metavar="FILE", help="File to write; it must not be there yet.")]) -> None:
    """Write a new random key to a file that only its owner can read.

    Give each robot a copy and name it in the scenario: ``radio: {key: FILE}``.
    """
    new_key(path)
    typer.echo(f"{path}: a new key; name it in the scenario as radio.key")
