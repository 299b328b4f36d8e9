"""The command `fogwatch`. Commands import the heavy libraries that they need, so that help and errors are quick."""

from __future__ import annotations

import platform
from importlib import metadata
from typing import Annotated

import typer

from fogwatch.cli import command_help
from fogwatch.cli.command_help import command
from fogwatch.cli.ending import run_app
from fogwatch.cli.studies import add_studies
from fogwatch.commands import (  # noqa: F401 - each adds its commands; `map` comes with the studies, which add one to it
    animate,
    control,
    doctor,
    fleet,
    judge,
    page,
    processes,
    recording,
    report,
    run,
    scenario,
    status,
)

app = command_help.app


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"fogwatch {metadata.version('fogwatch')}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_print_version, help="Print the version and exit.")
    ] = False,
) -> None:
    """Take the options that stand before a command; see `app` for the help text."""


@command(examples=["fogwatch version"])
def version() -> None:
    """Print the versions of fogwatch, of Python and of the main libraries."""
    print(f"fogwatch {metadata.version('fogwatch')}")
    print(f"Python {platform.python_version()} on {platform.platform()}")
    for name in ("eclipse-zenoh", "numpy", "numba", "pydantic", "msgpack", "Pillow", "matplotlib", "scipy"):
        try:
            print(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            print(f"{name} not installed")


add_studies()


def main() -> int:
    """Run the command `fogwatch` with this process's arguments."""
    return run_app(app)
