"""``fogwatch intruder``: how often an intruder would have succeeded in a run. Raises BadInput; the caller prints it."""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer

from experiments.intruders.infiltrator import KNOWLEDGE, PANEL, Infiltrator
from experiments.intruders.standing import ATTACKS_S
from fogwatch.cli.columns import drawn
from fogwatch.cli.command_help import command
from fogwatch.cli.ending import say
from fogwatch.cli.open_run import RunFolder, open_folder, print_state
from fogwatch.cli.options import option
from fogwatch.own_classes import find_classes
from monitor.tables.table import Table
from patrol.errors import BadInput, printable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from experiments.intruders.game import Game, Infiltration, Percent
    from experiments.intruders.standing import Successes

ATTACKS = ",".join(f"{attack_s:g}" for attack_s in ATTACKS_S)


@command(
    examples=[
        "fogwatch intruder runs/yards-20260101-120000",
        "fogwatch intruder RUN --speed 3 --entries doors --zone vault",
        "fogwatch intruder RUN --again --attempts 50",
        "fogwatch intruder RUN --code --attempts 50",
        "fogwatch intruder RUN --attacks 30,90,180 --json",
    ]
)
def intruder(
    run: RunFolder,
    attacks: Annotated[str, option("S,S,...", "Durations of attacks, simulated seconds.")] = ATTACKS,
    *,
    infiltrator: Infiltrator,
    again: Annotated[
        bool,
        option(
            "",
            "Also plan again every second from what is then seen: about a second for each attempt.",
            "--again",
            panel=PANEL,
        ),
    ] = False,
    code: Annotated[
        bool,
        option(
            "",
            "Also play one that has the scenario and the code, but not the secret of the draws. It runs the scenario "
            "again, with its policy and its key, so only for runs that you trust; each attempt simulates 5 futures.",
            "--code",
            panel=PANEL,
        ),
    ] = False,
    as_json: Annotated[bool, option("", "Print JSON.", "--json")] = False,
) -> None:
    """Play intruder games on a run: how often could an intruder stay at a place, or get in, unseen?

    Random attacks any place at any time. Waiting attacks a place that has just been left. Statistical has learned from
    the first half of the run after which time a place is likely to stay unseen. An attack succeeds if no robot sees
    the place until it is over. The games are also played on the vertices of terrain.graph, or of the graph made from
    the ground, where a robot must come within `terrain.graph.visit` (0.4 m), as in the literature.

    The moving intruder has watched from the start. At a random moment it plans a way from outside to a random place and
    a stay there, on which it expects to be seen least; it gets in if no robot sees it until its stay is over. The gain
    of watching says how many more attempts in a hundred succeed than without any knowledge: 0 is a patrol that
    watching does not help against. It needs a run of 600 s or more.
    """
    durations = _read_durations(attacks)
    opened, going = open_folder(run)
    from experiments.intruders.on_run import Moving, games_of
    from fogwatch.terminal.live_table import bar_on

    if code:
        find_classes([opened.prepared.scenario])
    with bar_on() as bar:
        futures = bar.add_task("simulated futures, %", total=100, visible=code)
        moves = bar.add_task("moving intruder, %", total=100)

        def prepare(game: Game) -> None:
            if code:
                from experiments.intruders.simulated_futures import add_code

                add_code(game, opened.prepared, lambda share: bar.update(futures, completed=100.0 * share))

        moving = Moving(infiltrator, again, lambda share: bar.update(moves, completed=100.0 * share), prepare)
        games = games_of(opened, durations, moving)
    if games.no_moving and (infiltrator != Infiltrator() or again or code):
        raise BadInput(games.no_moving)
    if as_json:
        typer.echo(json.dumps(asdict(games), indent=2))
        return
    print_state(opened, going)
    _print_shares(f"{games.points} points of the ground", games.ground)
    _print_shares(f"{games.vertices} vertices of the graph", games.nodes)
    if games.moving is not None:
        _print_moving(games.moving, infiltrator)
    if games.no_moving:
        typer.echo(printable(games.no_moving), err=True)


def _read_durations(text: str) -> list[float]:
    durations = []
    for word in text.split(","):
        try:
            value = float(word)
        except ValueError:
            value = math.nan
        if not 0.0 < value <= 1e6:
            raise BadInput(f"--attacks {printable(text)}: expected seconds above 0, such as {ATTACKS}")
        durations.append(value)
    return durations


def _print_table(title: str, heads: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    from rich.console import Console

    say(title)
    Console(highlight=False).print(drawn(Table(heads, rows, range(1, len(heads)))))


def _print_shares(where: str, shares: Sequence[Successes]) -> None:
    heads = ("attack", "random", "waiting", "statistical", "worst")
    rows = []
    for share in shares:
        numbers = [share.random, share.waiting, share.statistical, share.worst]
        rows.append([f"{share.attack_s:g} s", *("-" if number is None else f"{number:.1%}" for number in numbers)])
    _print_table(f"attacks that succeed, on {where}", heads, rows)


def _print_moving(outcome: Infiltration, infiltrator: Infiltrator) -> None:
    plans = {"plans once": (outcome.once, outcome.gain)}
    if outcome.again_gain is not None:
        plans["again every second"] = outcome.again, outcome.again_gain
    rows = [
        [words, *(_percent_text(shares.get(name)) for shares, _ in plans.values())]
        for name, words in KNOWLEDGE.items()
        if name in outcome.once
    ]
    rows.append(["gain of watching, percentage points", *(_percent_text(gain.watching) for _, gain in plans.values())])
    if outcome.gain.code is not None:
        gains = (_percent_text(gain.code) for _, gain in plans.values())
        rows.append(["gain of scenario and code, likewise", *gains])
    title = f"a moving intruder gets in, {outcome.attempts} attempts (%, 95 % interval)"
    _print_table(title, ["an intruder that", *plans], rows)
    where = f"at least {outcome.depth_m:.0f} m inside" if infiltrator.zone is None else f"in {infiltrator.zone}"
    typer.echo(
        f"{outcome.speed:.3g} m/s, {infiltrator.stay_s:g} s at the target, {infiltrator.within_s:g} s in all; "
        f"{outcome.targets} targets {printable(where)}, points of {outcome.point_m:g} m"
    )


def _percent_text(value: Percent | None) -> str:
    return "-" if value is None else f"{value.percent:.0f} ({value.low:.0f} to {value.high:.0f})"
