"""The option ``--patrol`` of several commands."""

from __future__ import annotations

from typing import Any

import typer

from patrol.scenario.patrols import PATROLS, PRICES


def patrol_option(panel: str | None = None) -> Any:
    """Return the option ``--patrol``, for the annotation of a parameter.

    The help lists it in `panel`; None for the first.
    """
    return typer.Option(
        "--patrol",
        metavar="|".join(PATROLS),
        help=f"{PRICES}. Short for --set patrol.policy={'|'.join(patrol.policy for patrol in PATROLS.values())}.",
        rich_help_panel=panel,
    )
