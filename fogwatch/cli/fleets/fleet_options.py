"""The options that name a running fleet, which `fogwatch monitor`, `record` and `status` have in common."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from patrol.errors import BadInput

WAIT_S = 60.0
LONGEST_WAIT_S = 86400.0

CredentialsOption = Annotated[
    Path | None,
    typer.Option(
        "--credentials",
        metavar="PATH",
        help="A viewer's credentials, made by fogwatch fleet init, or the folder of a run of this machine.",
    ),
]
Router = Annotated[str | None, typer.Option(metavar="LOCATOR", help="Router of a running fleet, tcp/HOST:PORT.")]
Fleet = Annotated[str | None, typer.Option(metavar="NAME", help="Name of the running fleet.")]
FleetScenario = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Scenario of a fleet without a world, to follow its robots by their positions."),
]
Radio = Annotated[
    str | None,
    typer.Option(
        metavar="LOCATOR|FOLDER",
        help="Direct radio of a fleet without a world: group, line, router, or this member's folder in a mesh.",
    ),
]


def _checked_wait(wait_s: float) -> float:
    if not 0.0 <= wait_s <= LONGEST_WAIT_S:
        raise BadInput(f"--wait {wait_s:g}: expected 0 to {LONGEST_WAIT_S:g} (a day)")
    return wait_s


Wait = Annotated[float, typer.Option(metavar="S", help="How long to wait for the fleet, in s.", callback=_checked_wait)]


def check_one_fleet(
    command: str, run: Path | None, credentials: Path | None, router: str | None, fleet: str | None
) -> None:
    """Check that a command is given one of the folder of a run, credentials, or both a router and a fleet's name."""
    named = (router is not None) + (fleet is not None)
    if (run is not None and (named or credentials is not None)) or (run is None and credentials is None and named != 2):
        raise BadInput(f"{command}: name a run's folder, or --router and --fleet of a running fleet, or --credentials")


def fleet_access(command: str, run: Path | None, scenario: Path | None) -> Path | None:
    """Return what gives the right to control a running fleet, from a command's RUN; None without one.

    RUN is as for `control_file`. A `scenario` is of robots without a world, which an operator may watch as well; with
    the folder of a run, which has a scenario of its own, it is refused.
    """
    from patrol.net.security.credentials import MEMBER

    if run is None:
        return None
    if scenario is not None and run.is_dir() and not (run / MEMBER).is_file():
        raise BadInput(f"{command}: --scenario is for robots without a world, and {run} has one; leave the option out")
    return control_file(command, run)


def control_file(command: str, run: Path) -> Path:
    """Return the file that says how to reach and control a running fleet.

    `run` is the fleet's folder, its control file, or an operator's credentials.
    """
    from monitor.replay.run_files import JOURNAL
    from patrol.net.security.access import FILE
    from patrol.net.security.credentials import MEMBER

    if (run.is_file() and run.name != JOURNAL) or (run / MEMBER).is_file():
        return run
    if not run.is_dir():
        raise BadInput(f"{command} {run}: no such folder; name a running fleet's, such as runs/yards-20260101-120000")
    if not (run / FILE).is_file():
        raise BadInput(
            f"{command} {run}: holds no {FILE}, so no fleet is running there, or not yet; for a finished run use: "
            f"fogwatch replay {run}"
        )
    return run / FILE
