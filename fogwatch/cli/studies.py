"""The commands of the studies, which are found by name: without the package `experiments` each says what brings it."""

from __future__ import annotations

from collections.abc import Callable

import typer

from fogwatch.cli.command_help import MANY
from patrol.errors import BadInput
from patrol.extras import study

NAMES = ("plan", "intruder", "sweep", "benchmark", "experiment", "paper", "reproduce")


def add_studies(app: typer.Typer, map_group: typer.Typer) -> None:
    """Add the studies' commands to the command `fogwatch`, and to its group `map`."""
    try:
        register = study("commands.register").register
    except BadInput as missing:
        for group, name in (*((app, name) for name in NAMES), (map_group, "random")):
            accept_all = {"allow_extra_args": True, "ignore_unknown_options": True, "help_option_names": []}
            group.command(name, help=f"{missing}.", context_settings=accept_all, rich_help_panel=MANY)(_refuse(missing))
    else:
        register(app, map_group)


def _refuse(missing: BadInput) -> Callable[[typer.Context], None]:
    def refuse(ctx: typer.Context) -> None:
        raise BadInput(f"fogwatch {ctx.info_name}: {missing}")

    return refuse
