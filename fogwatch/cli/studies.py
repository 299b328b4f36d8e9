"""The commands of the studies, which are found by name: without the package `experiments` each says what brings it."""

from __future__ import annotations

from collections.abc import Callable

import typer

from fogwatch.cli.command_help import PANEL_OF, app
from fogwatch.commands.map import app as map_app
from patrol.errors import BadInput
from patrol.extras import study


def add_studies() -> None:
    """Add the studies' commands; without the studies, those of `PANELS` that are missing so far, and ``map random``."""
    try:
        study("commands")
    except BadInput as missing:
        names = {command.name for command in app.registered_commands} | {
            command.name for command in app.registered_groups
        }
        absent = [(app, name, panel) for name, panel in PANEL_OF.items() if name not in names]
        for group, name, panel in [*absent, (map_app, "random", None)]:
            accept_all = {"allow_extra_args": True, "ignore_unknown_options": True, "help_option_names": []}
            group.command(name, help=f"{missing}.", context_settings=accept_all, rich_help_panel=panel)(
                _make_refusal(missing)
            )


def _make_refusal(missing: BadInput) -> Callable[[typer.Context], None]:
    def refuse(ctx: typer.Context) -> None:
        raise BadInput(f"{ctx.command_path}: {missing}")

    return refuse
