"""``fogwatch plan``: how many robots some ground needs. Raises BadInput; the caller prints it."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from patrol.errors import BadInput
from patrol.matplotlib_check import check_matplotlib
from patrol.pose import MODELS
from patrol.printable import printable
from patrol.process.lifeline import heed
from patrol.process.starting.seldom import SELDOM
from patrol.process.starting.warmup import warm
from patrol.scenario import BUILTINS, naming, open_scenario, parse_overrides

if TYPE_CHECKING:
    from experiments.plan.plan import AgeKept, FleetPlan, FleetSize

NOT_KEPT = 1
"""The exit code when no number of robots keeps the wanted age."""

EXAMPLES = [
    "fogwatch plan yards --age 60 --model holonomic --radius 0.3 --speed 1",
    "fogwatch plan my-map.yaml --robots 1-8 --quick",
]
EXIT_CODES = "0 done, 1 no number of robots keeps the age, 2 bad input, 130 interrupted"
BODY = "Robots"
OUTPUT = "Output"


def plan(
    what: Annotated[
        str,
        typer.Argument(
            metavar="SCENARIO",
            help=f"Map file (map_server's YAML), built-in terrain ({', '.join(BUILTINS)}) or scenario file.",
        ),
    ],
    age: Annotated[
        float | None, typer.Option(metavar="S", help="Age that nothing is to exceed, in s: find the number of robots.")
    ] = None,
    robots: Annotated[
        str | None, typer.Option(metavar="N|N-M", help="Numbers of robots to look at, at most 24: find their ages.")
    ] = None,
    model: Annotated[
        str | None, typer.Option(metavar="|".join(MODELS), help="Body model.", rich_help_panel=BODY)
    ] = None,
    radius: Annotated[float | None, typer.Option(metavar="M", help="Body radius in m.", rich_help_panel=BODY)] = None,
    speed: Annotated[float | None, typer.Option(metavar="M/S", help="Top speed in m/s.", rich_help_panel=BODY)] = None,
    turning_radius: Annotated[
        float | None, typer.Option(metavar="M", help="Tightest turn of a car, in m.", rich_help_panel=BODY)
    ] = None,
    sensor_range: Annotated[
        float | None, typer.Option(metavar="M", help="Range of the sensor in m.", rich_help_panel=BODY)
    ] = None,
    point: Annotated[float | None, typer.Option(metavar="M", help="Side of one grid point in m.")] = None,
    duration: Annotated[
        float | None,
        typer.Option(metavar="S", help="Length of each simulated run in s (default: 12 ages, at least 600 s)."),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="FIELD=VALUE", help="Set any field of the scenario. Repeatable."),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Compute bounds and tours, and simulate nothing.")] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Folder of the results, new or empty (default: runs/plan-NAME).", rich_help_panel=OUTPUT
        ),
    ] = None,
) -> int:
    """Find out how many robots some ground needs so that nothing is older than an age, or what age robots keep.

    For each number of robots: a lower bound, one tour for all, and a tour for each over a division of the ground. Then
    fleets are simulated. A number keeps an age if nothing is older in its simulated run after the first quarter. The
    chosen number is also run with one robot dead from the middle on, and with free choices alone. Faults and intruders
    of a scenario are left out.
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
    numbers = None if robots is None else _numbers(robots)
    overrides: dict[str, object] = {
        "robots.model": model,
        "robots.radius": radius,
        "robots.speed": speed,
        "robots.turning_radius": turning_radius,
        "sensor.range": sensor_range,
        "point": point,
    }
    given = {field: value for field, value in overrides.items() if value is not None}
    overridden = {**given, **parse_overrides(settings or [])}
    scenario = open_scenario(what, overridden)
    check_matplotlib("sim")
    heed(None, patience=0)  # any signal raises KeyboardInterrupt
    warm(("patrol", "agent", "worldsim"), lambda line: typer.echo(line, err=True), SELDOM)
    from experiments.plan.plan import make_plan  # here: these import kernels, which are compiled first
    from fogwatch.plan_folder import plan_folder, write_plan

    folder = plan_folder(out, scenario.name)
    shown = _Shown(Console(stderr=True))
    with shown.bar, naming(what, overridden):
        made = make_plan(scenario, age, numbers, shown, duration_s=duration, quick=quick)
        shown.begin("pictures")
        write_plan(made, folder)
    console = Console()
    console.print(_table(made), highlight=False, markup=False)
    for line in plain_lines(made):
        console.print(printable(line), highlight=False, markup=False, soft_wrap=True)
    console.print(printable(f"files: {folder}"), highlight=False, markup=False, soft_wrap=True)
    return NOT_KEPT if age is not None and made.chosen is None else 0


def plain_lines(plan: FleetPlan) -> Iterator[str]:
    """Say what a plan comes to.

    Args:
        plan: The plan.

    Yields:
        Lines of text.
    """
    from patrol.measures.best_tour import NO_BOUND  # here: it imports kernels

    if plan.wanted_s is not None and any(size.simulated is None for size in plan.sizes):
        yield "in brackets: by the better of the tours, not simulated"
    if any(size.bound_s == 0.0 for size in plan.sizes):
        yield f"bound -: {NO_BOUND}"
    if all(size.age_s is None for size in plan.sizes):
        yield "tours -: the sensor does not look all around or leaves some of an age, or the ground is too large"
    areas = [size.area_m2 for size in plan.sizes]
    if max(areas) > 1.01 * min(areas):
        yield f"ground: fewer robots start in fewer parts and reach less of it, {min(areas):.0f} to {max(areas):.0f} m²"
    yield from _on_patrol(plan)
    if plan.wanted_s is not None:
        yield from _answer(plan, plan.wanted_s)
    if plan.chosen is not None:
        yield from _tests(plan.size(plan.chosen), plan.wanted_s)


def _on_patrol(plan: FleetPlan) -> Iterator[str]:
    """Say for how much of the time robots with a battery patrol."""
    spec = plan.scenario.roster[0]
    if spec.battery is None or not plan.scenario.docks:
        return
    robots = plan.sizes[-1].robots if plan.chosen is None else plan.chosen
    share, most = spec.battery.patrol_share(spec.speed), spec.battery.most_on_patrol(robots, spec.speed)
    yield f"batteries: on patrol for {100.0 * share:.0f} % of the time; of {_robots(robots)}, {most} at a time"


def _answer(plan: FleetPlan, wanted_s: float) -> Iterator[str]:
    """Say how many robots keep the wanted age."""
    how = "on the better of the tours" if plan.quick else "in a simulated run"
    if plan.chosen is None:
        yield f"answer: none of these numbers of robots keeps {wanted_s:g} s {how}; {_remedy(plan, wanted_s)}"
        return
    size = plan.size(plan.chosen)
    if plan.quick:
        yield f"answer: {_robots(plan.chosen)}, by tours alone: {_age(size.age_s)} s; run it without --quick"
        return
    yield f"answer: {_keep(plan.chosen, wanted_s, True)}: {_kept(size.simulated)}"
    fewer = next((size for size in plan.sizes if size.robots == plan.chosen - 1), None)
    if fewer is not None and fewer.simulated is not None:
        yield f"one fewer: {_keep(fewer.robots, wanted_s, False)}: {_kept(fewer.simulated)}"


def _remedy(plan: FleetPlan, wanted_s: float) -> str:
    """Say what may help where no number keeps the wanted age."""
    last = plan.sizes[-1]
    if last.tour_s is None:
        return "give --robots with larger numbers, or a longer --age"
    needed = math.ceil(last.tour_s * last.robots / wanted_s)
    return f"one tour for all needs about {needed}; give a longer --age, a faster body or a longer --sensor-range"


def _tests(size: FleetSize, wanted_s: float | None) -> Iterator[str]:
    """Say what the chosen fleet keeps with one robot dead, and with free choices alone."""
    if (dead := size.one_dead) is not None:
        rest = f"{_robots(size.robots - 1)} left, {_holding(dead, wanted_s)}{_kept(dead)}"
        yield f"one dead: {rest}; largest since its death {_age(dead.peak_s)} s"
    if size.stochastic is not None:
        yield f"stochastic (unpredictability: 1): {_holding(size.stochastic, wanted_s)}{_kept(size.stochastic)}"
    for kept in (size.simulated, size.one_dead, size.stochastic):
        if kept is not None:
            yield from (f"warning: {kept.scenario.name}: {warning}" for warning in kept.warnings)


def _holding(kept: AgeKept, wanted_s: float | None) -> str:
    if wanted_s is None:
        return ""
    return f"{'keeps' if kept.keeps(wanted_s) else 'does not keep'} {wanted_s:g} s: "


def _keep(robots: int, wanted_s: float, holds: bool) -> str:
    one = robots == 1
    verb = ("keeps" if one else "keep") if holds else ("does not keep" if one else "do not keep")
    return f"{_robots(robots)} {verb} {wanted_s:g} s"


def _kept(kept: AgeKept | None) -> str:
    if kept is None:
        return ""
    end_s = kept.scenario.duration
    invalid = "" if kept.outcome == "valid" else f"; verdict {kept.outcome}"
    return f"largest {_age(kept.max_s)} s, mean {_age(kept.mean_s)} s, from {kept.from_s:g} s to {end_s:g} s{invalid}"


def _table(plan: FleetPlan) -> Table:
    table = Table("robots", box=None, pad_edge=False, header_style="cyan")
    wanted = plan.wanted_s
    for title in ("bound (s)", "one tour (s)", "own tours (s)", "simulated: mean (s)", "largest (s)"):
        table.add_column(title, justify="right")
    if wanted is not None:
        table.add_column(f"keeps {wanted:g} s")
    for size in plan.sizes:
        simulated = size.simulated
        cells = [_age(size.bound_s or None), _age(size.tour_s), _age(size.own_tours_s)]
        cells += ["-", "-"] if simulated is None else [_age(simulated.mean_s), _age(simulated.max_s)]
        if wanted is not None:
            cells.append(_keeps(size, wanted))
        table.add_row(str(size.robots), *cells)
    table.columns[0].justify = "right"
    return table


def _keeps(size: FleetSize, wanted_s: float) -> str:
    if size.simulated is not None:
        return "yes" if size.simulated.keeps(wanted_s) else "no"
    return "-" if size.age_s is None else "(yes)" if size.age_s <= wanted_s else "(no)"


def _age(seconds: float | None) -> str:
    return "-" if seconds is None else f"{seconds:.1f}"


def _robots(number: int) -> str:
    from experiments.plan.plan import robots_text  # here: it imports kernels

    return robots_text(number)


def _numbers(text: str) -> range:
    """Read numbers of robots: N or N-M."""
    from patrol.measures.best_tour import MOST_ROBOTS  # here: it imports kernels

    match = re.fullmatch(r"(\d{1,3})(?:-(\d{1,3}))?", text.strip())
    first, last = (int(match[1]), int(match[2] or match[1])) if match else (0, 0)
    if not 1 <= first <= last <= MOST_ROBOTS:
        raise BadInput(f"--robots {text}: expected a number or two with a hyphen, 1 to {MOST_ROBOTS}, such as 1-8")
    return range(first, last + 1)


class _Shown:
    """Shows what a plan is at: a bar on a terminal, lines elsewhere. Implements `experiments.plan.plan.Observer`.

    Attributes:
        bar: A context manager that shows it and clears it away.
    """

    def __init__(self, console: Console) -> None:
        self._console = console
        columns = (TextColumn("{task.description}", style="cyan"), BarColumn(), TimeElapsedColumn())
        self.bar = Progress(*columns, console=console, transient=True, disable=not console.is_terminal)
        self._task = self.bar.add_task("plan", total=1.0)

    def begin(self, what: str) -> None:
        """Show what is computed next."""
        self.bar.update(self._task, description=what, completed=0.0)
        if not self._console.is_terminal:
            self._console.print(f"{what} ...", highlight=False, markup=False, soft_wrap=True)

    def share(self, done: float) -> None:
        """Show the share of it that is done."""
        self.bar.update(self._task, completed=done)
