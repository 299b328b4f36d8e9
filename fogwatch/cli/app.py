"""The command `fogwatch`, with the commands of the studies where they are installed.

Commands import the heavy libraries that they need, so that help and errors are quick.
"""

from __future__ import annotations

import platform
from collections.abc import Callable
from importlib import metadata
from typing import Annotated

import typer

from fogwatch.cli import command_help
from fogwatch.cli.command_help import PANEL_OF, command
from fogwatch.cli.ending import run_app
from fogwatch.commands import (  # noqa: F401 - each adds its commands
    animate,
    control,
    doctor,
    fleet,
    judge,
    page,
    plan,
    processes,
    recording,
    report,
    run,
    scenario,
    status,
)
from fogwatch.commands import map as map_commands  # noqa: F401 - likewise
from patrol.errors import BadInput
from patrol.extras import study

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


def add_studies() -> None:
    """Add the studies' commands; without the studies, refusals in place of those of `PANELS` that are missing."""
    try:
        study("commands")
    except BadInput as missing:
        names = {command.name for command in app.registered_commands}
        names |= {group.name for group in app.registered_groups}
        accept_all = {"allow_extra_args": True, "ignore_unknown_options": True, "help_option_names": []}
        refuse = _make_refusal(missing)
        for name, panel in PANEL_OF.items():
            if name not in names:
                app.command(name, help=f"{missing}.", context_settings=accept_all, rich_help_panel=panel)(refuse)


def _make_refusal(missing: BadInput) -> Callable[[typer.Context], None]:
    def refuse(ctx: typer.Context) -> None:
        raise BadInput(f"{ctx.command_path}: {missing}")

    return refuse


add_studies()


def main() -> int:
    """Run the command `fogwatch` with this process's arguments."""
    return run_app(app)
