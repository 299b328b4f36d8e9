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

    from rich.progress import Progress

    from patrol.measures.intruders import Successes
    from patrol.measures.learned_intruder import Learned

EXAMPLES = [
    "fogwatch intruder runs/yards-20260101-120000",
    "fogwatch intruder RUN --attacks 30,90,180 --json",
    "fogwatch intruder RUN --attacks 30,90,180 --learned --horizon 300,1200,3600",
]
ATTACKS = ",".join(f"{attack_s:g}" for attack_s in ATTACKS_S)
HORIZONS = "300"
TRIALS = 50


def intruder(
    run: Annotated[Path, RUN],
    attacks: Annotated[str, typer.Option(metavar="S,S,...", help="Durations of attacks, simulated seconds.")] = ATTACKS,
    learned: Annotated[
        bool,
        typer.Option("--learned", help="Play the learned intruder too: 0.1 to 0.3 ms for each second of each trial."),
    ] = False,
    horizon: Annotated[
        str | None,
        typer.Option(
            metavar="S,S,...",
            help="How long the learned intruder watches and attacks, simulated seconds; the paper's are 300,1200,3600 "
            f"(default: {HORIZONS}).",
        ),
    ] = None,
    trials: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=1,
            max=1000,
            help=f"Trials of the learned intruder, spread over the run (default: {TRIALS}).",
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Play intruder games on a run: how often could somebody stay at a place unseen for as long as an attack takes?

    Random attacks any place at any time. Waiting attacks a place that has just been left. Statistical has learned from
    the first half of the run after which time a place is likely to stay unseen. An attack succeeds if no robot sees
    the place until it is over. The games are also played on the vertices of terrain.graph, or of the graph made from
    the ground, where a robot must come within `terrain.graph.visit` (0.4 m), as in the literature.

    Learned is a neural network that watches for half of its horizon, then attacks once, where and when it expects
    success. With six durations, 50 trials of 300 s take half a minute; the paper's durations and horizons four minutes.
    """
    durations = _seconds("--attacks", attacks, ATTACKS)
    for option, value in (("--horizon", horizon), ("--trials", trials)):
        if value is not None and not learned:
            raise BadInput(f"{option} {value}: only the learned intruder has it; add --learned")
    horizons = _seconds("--horizon", horizon or HORIZONS, HORIZONS)
    opened, going = open_folder(run)
    from monitor.replay.intruder_games import games_of
    from patrol.measures.learned_intruder import Trials

    played = Trials(tuple(horizons), trials or TRIALS) if learned else None
    with _bar() as bar:
        task = bar.add_task("learned intruder, %", total=100, visible=learned)
        games = games_of(opened, durations, played, lambda share: bar.update(task, completed=100.0 * share))
    if as_json:
        typer.echo(json.dumps(asdict(games), indent=2))
        return
    print_state(opened, going)
    _print(f"{games.points} points of the ground", games.ground, games.learned_ground)
    _print(f"{games.vertices} vertices of the graph", games.nodes, games.learned_nodes)
    if learned:
        where = f"{games.learned_points} of the points and all vertices"
        counted = "one trial, which" if trials == 1 else f"{trials or TRIALS} trials, each of which"
        typer.echo(f"learned: share of {counted} attacks one place, on {where}")


def _seconds(option: str, text: str, example: str) -> list[float]:
    found = []
    for word in text.split(","):
        try:
            value = float(word)
        except ValueError:
            value = math.nan
        if not 0.0 < value <= 1e6:
            raise BadInput(f"{option} {printable(text)}: expected seconds above 0, such as {example}")
        found.append(value)
    return found


def _bar() -> Progress:
    from rich.console import Console
    from rich.progress import TimeRemainingColumn

    from fogwatch.progress import bar_on

    return bar_on(Console(stderr=True), TimeRemainingColumn())


def _print(where: str, shares: Sequence[Successes], learned: Sequence[Learned]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title=f"attacks that succeed, on {where}", title_justify="left")
    horizons = list(dict.fromkeys(outcome.horizon_s for outcome in learned))
    headings = [f"learned {horizon_s:g} s" for horizon_s in horizons]
    for heading in ("attack", "random", "waiting", "statistical", "worst", *headings):
        table.add_column(heading, justify="right")
    for row, share in enumerate(shares):
        numbers = [share.random, share.waiting, share.statistical, share.worst]
        numbers += [learned[number * len(shares) + row].success for number in range(len(horizons))]
        table.add_row(f"{share.attack_s:g} s", *("-" if number is None else f"{number:.1%}" for number in numbers))
    Console(highlight=False).print(table)
