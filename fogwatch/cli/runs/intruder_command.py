"""``fogwatch intruder``: how often an intruder would have succeeded in a run. Raises BadInput; the caller prints it."""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fogwatch.cli.runs.open_run import RUN, open_folder, print_state
from patrol.errors import BadInput
from patrol.measures.intruders import ATTACKS_S
from patrol.printable import printable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from patrol.measures.intruders import Successes

EXAMPLES = ["fogwatch intruder runs/yards-20260101-120000", "fogwatch intruder RUN --attacks 30,90,180 --json"]
ATTACKS = ",".join(f"{attack_s:g}" for attack_s in ATTACKS_S)


def intruder(
    run: Annotated[Path, RUN],
    attacks: Annotated[str, typer.Option(metavar="S,S,...", help="Durations of attacks, simulated seconds.")] = ATTACKS,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Play intruder games on a run: how often could somebody stay at a place unseen for as long as an attack takes?

    Random attacks any place at any time. Waiting attacks a place that has just been left. Statistical has learned from
    the first half of the run after which time a place is likely to stay unseen. An attack succeeds if no robot sees
    the place until it is over. With terrain.graph the games are played on its vertices as well, where a robot must come
    within `terrain.graph.visit` (0.4 m), as in the literature.
    """
    durations = _durations(attacks)
    opened, going = open_folder(run)
    from monitor.replay.intruder_games import games_of

    games = games_of(opened, durations)
    if as_json:
        typer.echo(json.dumps(asdict(games), indent=2))
        return
    print_state(opened, going)
    _print(f"{games.points} points of the ground", games.ground)
    if games.nodes:
        _print(f"{games.vertices} vertices of the graph", games.nodes)


def _durations(text: str) -> list[float]:
    found = []
    for word in text.split(","):
        try:
            value = float(word)
        except ValueError:
            value = math.nan
        if not 0.0 < value <= 1e6:
            raise BadInput(f"--attacks {printable(text)}: expected seconds above 0, such as {ATTACKS}")
        found.append(value)
    return found


def _print(where: str, shares: Sequence[Successes]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title=f"attacks that succeed, on {where}", title_justify="left")
    for heading in ("attack", "random", "waiting", "statistical", "worst"):
        table.add_column(heading, justify="right")
    for share in shares:
        numbers = (share.random, share.waiting, share.statistical, share.worst)
        table.add_row(f"{share.attack_s:g} s", *("-" if number is None else f"{number:.1%}" for number in numbers))
    Console(highlight=False).print(table)
