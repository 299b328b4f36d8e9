"""``fogwatch status``: a running fleet at one look. Raises BadInput; the caller prints it."""

from __future__ import annotations

import json
from contextlib import nullcontext
from typing import TYPE_CHECKING, Annotated

import typer

from fogwatch.cli.command_help import command
from fogwatch.cli.options import option
from fogwatch.commands.fleet import LISTEN_S, FleetOptions, RunningFleet, Seconds, Wait
from runtime.process.failures import INTERRUPTED

if TYPE_CHECKING:
    from fogwatch.status import FleetWatch
    from monitor.observation.source import Source
    from runtime.process.lifeline import Ending

WRONG = 1
WAIT_S = 5.0
PATIENCE_S = 30.0
"""By how much a single look may take longer while a robot has not been heard, s."""
EVERY_S = 1.0
"""Time between two looks with --watch, s."""


@command(
    examples=[
        "fogwatch status runs/yards-20260101-120000",
        "fogwatch status --credentials yards-1/viewer --watch",
        "fogwatch status --router tcp/192.168.1.20:7447 --fleet patrol",
        "fogwatch status --router tcp/192.168.1.20:7447 --fleet patrol --scenario hall.yaml --json",
    ],
    exit_codes="0 all well, 1 something is wrong, 2 bad input, or no world of the fleet answers, 130 interrupted",
)
def status(
    run: RunningFleet = None,
    *,
    fleet: FleetOptions,
    watch: Annotated[bool, option("", "Look again each second, until the run ends or Ctrl-C.", "--watch")] = False,
    as_json: Annotated[bool, option("", "Print JSON, a line for each look.", "--json")] = False,
    seconds: Seconds = LISTEN_S,
    wait: Wait = WAIT_S,
) -> int:
    """Say how a running fleet does: its world, its robots, and what is wrong. It changes nothing.

    Wrong are robots that are dead, paused, lost, trapped or silent, and what a page would warn of. With a world, a
    robot is silent when no other robot has heard it for radio.forget_after. Robots without a world need their
    --scenario, which says which of them should be there. A robot is then silent that sends no position for
    radio.forget_after. Wrong is also a robot that reports not to hear another one.
    """
    from fogwatch.status import FleetWatch
    from monitor.live.attach import find_fleet
    from monitor.process import source_opener
    from patrol.scenario import load_scenario
    from runtime.process.lifeline import heed

    what = fleet.as_source("status", run, wait)
    if fleet.scenario is not None:
        load_scenario(fleet.scenario)
    ending = heed(None, patience=1)
    answer = find_fleet(ending, what.access, what.credentials, what.router, what.fleet, wait, shown="status")
    if answer is None:
        return INTERRUPTED
    met = answer[0]

    def open_source() -> Source | None:
        return next(iter(source_opener(what, ending)()), None)

    fleet_watch = FleetWatch(open_source, met.keys.fleet, met.meets_at, ending, 0.0 if watch else PATIENCE_S)
    try:
        return look_at(fleet_watch, seconds, ending, watch=watch, as_json=as_json)
    finally:
        fleet_watch.close()


def look_at(fleet_watch: FleetWatch, seconds: float, ending: Ending, *, watch: bool, as_json: bool) -> int:
    """Print the state of a fleet, with `watch` again and again until its run is over, and return the exit code.

    `seconds` is how long the first look listens; later ones take `EVERY_S`. JSON has a line for each look.
    """
    from rich.console import Console
    from rich.live import Live
    from rich.text import Text

    console = Console()
    in_place = watch and console.is_terminal and not as_json
    with Live(console=console, auto_refresh=False) if in_place else nullcontext() as live:
        while True:
            seen = fleet_watch.look(seconds)
            if ending or seen is None:
                return INTERRUPTED
            if live is not None:
                live.update(Text(seen.as_text()), refresh=True)
            else:
                typer.echo(json.dumps(seen.as_json()) if as_json else seen.as_text() + "\n" * watch)
            if seen.is_over or not watch:
                return 0 if seen.well else WRONG
            seconds = EVERY_S
