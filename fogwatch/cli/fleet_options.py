"""The options that name a running fleet, which `fogwatch monitor` and `fogwatch record` have in common."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from patrol.errors import BadInput

WAIT_S = 60.0

Router = Annotated[str | None, typer.Option(metavar="LOCATOR", help="Router of a running fleet, tcp/HOST:PORT.")]
Fleet = Annotated[str | None, typer.Option(metavar="NAME", help="Name of the running fleet.")]
FleetScenario = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Scenario of a fleet without a world, to follow its robots by their positions."),
]
Radio = Annotated[
    str | None,
    typer.Option(metavar="LOCATOR", help="Multicast group or router of the direct radio of a fleet without a world."),
]
Wait = Annotated[float, typer.Option(metavar="S", help="How long to wait for the fleet, in s.")]


def check_one_fleet(command: str, run: Path | None, router: str | None, fleet: str | None) -> None:
    """Check that a command is given either the folder of a run, or both the router and the name of a fleet.

    Args:
        command: Name of the command.
        run: The folder.
        router: The router.
        fleet: The fleet's name.

    Raises:
        BadInput: Too much is given, or too little.
    """
    named = (router is not None) + (fleet is not None)
    if named != (2 if run is None else 0):
        raise BadInput(f"{command}: name a run's folder, or --router and --fleet of a running fleet")
