"""``fogwatch plan``: how many robots some ground needs. Raises BadInput; the caller prints it."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from fogwatch.cli.columns import drawn
from fogwatch.cli.command_help import command
from fogwatch.cli.options import option
from fogwatch.run_options import Body, overrides_of, patrol_option, settings_option
from patrol.errors import BadInput, printable
from patrol.extras import check_matplotlib
from patrol.scenario import BUILTINS, changed_scenario, naming, open_scenario
from runtime.process.lifeline import heed
from runtime.starting.warmup import SELDOM, warm

if TYPE_CHECKING:
    from patrol.scenario import Scenario

NOT_KEPT = 1
"""The exit code when no number of robots keeps the wanted age."""

MOST_SEEDS = 100


@command(
    examples=[
        "fogwatch plan yards --age 60 --model holonomic --radius 0.3 --speed 1",
        "fogwatch plan my-map.yaml --robots 1-8 --quick",
    ],
    exit_codes="0 done, 1 no number of robots keeps the age, 2 bad input, 130 interrupted",
)
def plan(
    what: Annotated[
        str,
        typer.Argument(
            metavar="SCENARIO",
            help=f"Map file (map_server's YAML), built-in terrain ({', '.join(BUILTINS)}) or scenario file.",
        ),
    ],
    age: Annotated[float | None, option("S", "Age that nothing is to exceed, in s: find the number of robots.")] = None,
    robots: Annotated[str | None, option("N|N-M", "Numbers of robots to look at, at most 24: find their ages.")] = None,
    *,
    body: Body,
    point: Annotated[float | None, option("M", "Side of one grid point in m.")] = None,
    duration: Annotated[
        float | None,
        option("S", "Length of each simulated run in s (default: 12 times the age of the tours, at least 600 s)."),
    ] = None,
    patrol: Annotated[str | None, patrol_option()] = None,
    settings: Annotated[list[str] | None, settings_option("Set any field of the scenario. Repeatable.")] = None,
    seeds: Annotated[
        int | None, option("N", "Simulated runs of each number, each with another seed (default: 3).")
    ] = None,
    quick: Annotated[bool, option("", "Compute bounds and tours, and simulate nothing.", "--quick")] = False,
    out: Annotated[
        Path | None, option("DIR", "Folder of the results, new or empty (default: runs/plan-NAME).", panel="Output")
    ] = None,
) -> int:
    """Find out how many robots some ground needs so that nothing is older than an age, or what age robots keep.

    For each number of robots: a lower bound, one tour for all, and a tour for each over a division of the ground. Then
    fleets are simulated, with several seeds. A number keeps an age if nothing is older in any of its runs after the
    first quarter; where doors close, only open ground counts. The chosen number is also run with one robot dead from
    the middle on, and as the tour (for `--patrol tour`: as the stochastic patrol). Faults and intruders of a scenario
    are left out.
    """
    for name, value in (("age", age), ("duration", duration)):
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise BadInput(f"--{name} = {value:g}: expected a finite number above 0, in s")
    if age is None and robots is None:
        raise BadInput(
            "--age or --robots: one is needed, for example --age 60 for the number of robots that keeps 60 s"
        )
    if quick and duration is not None:
        raise BadInput(
            f"--duration {duration:g}: has no effect with --quick, which simulates nothing; drop one of them"
        )
    if seeds is not None and not 1 <= seeds <= MOST_SEEDS:
        raise BadInput(f"--seeds {seeds}: expected a number of runs from 1 to {MOST_SEEDS}")
    if quick and seeds is not None:
        raise BadInput(f"--seeds {seeds}: has no effect with --quick, which simulates nothing; drop one of them")
    numbers = None if robots is None else _read_numbers(robots)
    overridden = overrides_of(settings, patrol, point=point, **vars(body))
    scenario = open_scenario(what, overridden)
    body.check(scenario)
    check_matplotlib("sim")
    heed(None, patience=0)  # any signal raises KeyboardInterrupt
    warm(("patrol", "agent", "worldsim"), lambda line: typer.echo(line, err=True), SELDOM)
    from fogwatch.planning.answer import (  # here: these import kernels, which are compiled first
        answer_lines,
        answer_table,
    )
    from fogwatch.planning.folder import plan_folder, write_plan
    from fogwatch.planning.plan import SEEDS, make_plan

    folder = plan_folder(out, scenario.name)
    with naming(what, overridden):
        for line in _scenario_notes(scenario, 1 if numbers is None else numbers[-1]):
            typer.echo(printable(f"warning: {line}"), err=True)
    shown = _Shown(Console(stderr=True))
    with shown.bar, naming(what, overridden):
        new_plan = make_plan(scenario, age, numbers, shown.show, duration_s=duration, quick=quick, seeds=seeds or SEEDS)
        shown.show("pictures", 0.0)
        write_plan(new_plan, folder)
    console = Console()
    console.print(drawn(answer_table(new_plan)), highlight=False, markup=False)
    for line in answer_lines(new_plan):
        console.print(printable(line), highlight=False, markup=False, soft_wrap=True)
    console.print(printable(f"files: {folder}"), highlight=False, markup=False, soft_wrap=True)
    return NOT_KEPT if age is not None and new_plan.chosen is None else 0


def _scenario_notes(scenario: Scenario, most: int) -> list[str]:
    """Return the notes on the scenario with the most robots that a plan looks at, one if it searches for the number."""
    from fogwatch.grounds.scenario_notes import scenario_notes
    from fogwatch.planning.plan import planned_scenario  # here: these import kernels
    from patrol.prepare import prepare

    planned = changed_scenario(planned_scenario(scenario), {"robots.count": most})
    return scenario_notes(prepare(planned))


def _read_numbers(text: str) -> range:
    """Read numbers of robots: N or N-M."""
    from fogwatch.planning.plan import MOST_ROBOTS  # here: it imports kernels

    match = re.fullmatch(r"(\d{1,3})(?:-(\d{1,3}))?", text.strip())
    first, last = (int(match[1]), int(match[2] or match[1])) if match else (0, 0)
    if not 1 <= first <= last <= MOST_ROBOTS:
        raise BadInput(f"--robots {text}: expected a number or two with a hyphen, 1 to {MOST_ROBOTS}, such as 1-8")
    return range(first, last + 1)


class _Shown:
    """Shows the progress of a plan: a bar on a terminal, lines elsewhere.

    `bar` is a context manager that shows it and clears it away.
    """

    def __init__(self, console: Console) -> None:
        self._console = console
        columns = (TextColumn("{task.description}", style="cyan"), BarColumn(), TimeElapsedColumn())
        self.bar = Progress(*columns, console=console, transient=True, disable=not console.is_terminal)
        self._task = self.bar.add_task("plan", total=1.0)

    def show(self, what: str, done: float) -> None:
        """Show the present computation, and the share of it that is done."""
        self.bar.update(self._task, description=what, completed=done)
        if done == 0.0 and not self._console.is_terminal:
            self._console.print(f"{what} ...", highlight=False, markup=False, soft_wrap=True)
