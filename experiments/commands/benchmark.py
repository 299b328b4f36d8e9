"""``fogwatch benchmark``: policies beside each other, on a page. Raises BadInput; the caller prints it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, TypeVar

import typer
from rich.console import Console
from rich.table import Table

from experiments.benchmark import markdown
from experiments.benchmark.conditions import ALL, NONE
from experiments.benchmark.matrix import (
    Matrix,
    plan_of,
    read_conditions,
    read_policies,
    read_teams,
    read_terrains,
)
from experiments.benchmark.presets import PRESETS, Preset, beside_published, preset_matrix
from experiments.benchmark.results import (
    BenchmarkResults,
    cell_rows,
    describe,
    policy_table,
    results_of,
    run_rows,
)
from experiments.commands.sweep import (
    FAILED,
    ClusterAddress,
    Workers,
    make_runs,
    workers_of,
)
from experiments.sweeps.cases import cases_table, write_text
from experiments.sweeps.plan import check_classes, count_of_seeds
from experiments.sweeps.progress import command_line, print_failures
from fogwatch.terminal.live_table import duration_text
from patrol.errors import BadInput, did_you_mean
from patrol.extras import check_matplotlib
from patrol.pose import MODELS
from patrol.scenario import BUILTINS, Scenario, parse_overrides
from patrol.scenario.policies import LEARNED

EXAMPLES = [
    "fogwatch benchmark --quick",
    "fogwatch benchmark --policies stochastic,even-tour,sebs --terrains yards,site --conditions none,loss-90,deaths",
    "fogwatch benchmark --policies stochastic,stochastic:unpredictability=2,./mine.py:Mine --teams 2,4,8",
    "fogwatch benchmark --terrains plan.yaml --model differential --set robots.radius=0.3 --set robots.speed=1",
    "fogwatch benchmark --preset m2bench --map cumberland.yaml --graph cumberland.graph",
]

SEEDS, DURATION_S, POINT_M, TEAM, MODEL = 5, 1200.0, 0.5, 4, "holonomic"
QUICK_SEEDS, QUICK_DURATION_S, QUICK_POINT_M = 2, 300.0, 1.0

TAKEN = {
    "terrain.builtin": "--terrains",
    "terrain.map": "--terrains",
    "terrain.graph": "--terrains",
    "patrol.policy": "--policies",
    "patrol.options": "--policies",
    "robots.count": "--teams",
    "robots.model": "--model",
    "faults": "--conditions",
    "nemesis": "--conditions",
    "duration": "--duration",
    "point": "--point",
    "seed": "--seeds",
}
"""Fields that the benchmark sets, and the options for them."""

T = TypeVar("T")
Titled = tuple[str, Sequence[str], Sequence[Sequence[str]]]
"""A table's title, headings and rows."""

VARIED, RUN, PUBLISHED = "What is compared", "Each run", "Published numbers"


def benchmark(
    policies: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,...",
            help="Policies, each NAME, NAME:OPTION=VALUE or ./file.py:Class (default: all built-in ones). Here "
            "--patrol paper is potential-field, and --patrol tour is committed; tour is a cyclic strategy.",
            rich_help_panel=VARIED,
        ),
    ] = None,
    terrains: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,...",
            help=f"Built-in terrains, maps (MAP.yaml), or graphs with either (FILE.graph+MAP.yaml) (default: "
            f"{','.join(BUILTINS)}).",
            rich_help_panel=VARIED,
        ),
    ] = None,
    teams: Annotated[
        str | None,
        typer.Option(metavar="N,...", help=f"Numbers of robots (default: {TEAM}).", rich_help_panel=VARIED),
    ] = None,
    conditions: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,...",
            help=f"Of {', '.join(ALL)}; loss-P and jitter-P for any percentage, A+B for both (default: {NONE}).",
            rich_help_panel=VARIED,
        ),
    ] = None,
    seeds: Annotated[
        int | None,
        typer.Option(metavar="K", help=f"Run each cell with seeds 1 to K (default: {SEEDS}).", rich_help_panel=RUN),
    ] = None,
    duration: Annotated[
        float | None,
        typer.Option(metavar="S", help=f"Simulated time in s (default: {DURATION_S:g}).", rich_help_panel=RUN),
    ] = None,
    point: Annotated[
        float | None,
        typer.Option(metavar="M", help=f"Side of one grid point in m (default: {POINT_M:g}).", rich_help_panel=RUN),
    ] = None,
    model: Annotated[
        str | None,
        typer.Option(metavar="|".join(MODELS), help=f"Body model (default: {MODEL}).", rich_help_panel=RUN),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="FIELD=VALUE", help="Set another field of every run. Repeatable.", rich_help_panel=RUN
        ),
    ] = None,
    quick: Annotated[
        bool,
        typer.Option(
            "--quick",
            help=f"A first impression in minutes: {QUICK_SEEDS} seeds, {QUICK_DURATION_S:g} s, points of "
            f"{QUICK_POINT_M:g} m, unless given.",
            rich_help_panel=RUN,
        ),
    ] = False,
    preset: Annotated[
        str | None,
        typer.Option(
            metavar="|".join(PRESETS),
            help="The conditions of published numbers, which are shown beside ours.",
            rich_help_panel=PUBLISHED,
        ),
    ] = None,
    map_file: Annotated[
        Path | None,
        typer.Option("--map", metavar="FILE", help="With --preset: cumberland.yaml.", rich_help_panel=PUBLISHED),
    ] = None,
    graph_file: Annotated[
        Path | None,
        typer.Option("--graph", metavar="FILE", help="With --preset: cumberland.graph.", rich_help_panel=PUBLISHED),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder of the results, new and earlier ones (default: runs/benchmark)."),
    ] = None,
    workers: Workers = None,
    cluster: ClusterAddress = None,
) -> int:
    """Compare policies on terrains, in teams of several sizes, under faults, and write a page with curves.

    A cell is one policy on one terrain, in one team, under one condition; it is run once with each seed. Conditions are
    none, loss-50 (each frame is lost with 50 %), silence (no robot hears another), deaths (two robots die at 300 and
    1100 s, earlier in runs shorter than 1800 s), spoof (a stranger sends random positions in the name of r1) and
    jitter-20 (speeds change every 5 s by up to 20 %). Cells whose team is too small for their condition are left out.

    The folder gets benchmark.html (curves, tables, and for each cell the command that makes its run again), runs.csv,
    cells.csv with means and 95 % intervals, benchmark.md with the tables, and figures/. Runs that have a result there
    are not repeated, so an interrupted benchmark continues when it is started again.
    """
    console = Console()
    given = _overrides(settings or [])
    if policies is None:
        from agent.policies.found import POLICIES  # here: loads much

        policies = ",".join(name for name in POLICIES.built_in if name != LEARNED)  # which needs a network
    chosen = read_policies(policies)
    numbers = count_of_seeds(_default(seeds, QUICK_SEEDS if quick else SEEDS))
    if preset is not None:
        own = {"--terrains": terrains, "--teams": teams, "--conditions": conditions, "--duration": duration}
        _check_preset(preset, {**own, "--model": model, "--quick": quick or None})
        more = given if point is None else {"point": point, **given}
        matrix = preset_matrix(preset, chosen, numbers, map_file, graph_file, more)
    else:
        for option, file in (("--map", map_file), ("--graph", graph_file)):
            if file is not None:
                raise BadInput(f"{option} {file}: goes with --preset; give --terrains FILE.graph+MAP.yaml instead")
        matrix = Matrix(
            chosen,
            read_terrains(",".join(BUILTINS) if terrains is None else terrains),
            read_teams(str(TEAM) if teams is None else teams),
            read_conditions(NONE if conditions is None else conditions),
            numbers,
            _default(duration, QUICK_DURATION_S if quick else DURATION_S),
            {"point": _default(point, QUICK_POINT_M if quick else POINT_M), "robots.model": model or MODEL, **given},
        )
    plan = plan_of(matrix)
    check_classes(plan)
    if preset is not None:
        _check_ground(plan.runs[0].scenario, point)
    check_matplotlib("experiments")  # before hours of runs, not after them
    folder = out or Path("runs") / "benchmark"
    outcome = make_runs(plan, folder, workers_of(workers, cluster), console, estimate_time=True)
    results = results_of(matrix, outcome)
    _print(console, results, preset)
    print_failures(console, outcome)
    _write(folder, matrix, results, preset)
    made = f"{outcome.made} runs made in {duration_text(outcome.wall_s)}"
    files = f"{folder}: benchmark.html has all results; also benchmark.md, cells.csv, runs.csv, figures"
    console.print(f"{made}; {files}", highlight=False, soft_wrap=True)
    return FAILED if outcome.failed else 0


def _overrides(settings: Sequence[str]) -> dict[str, object]:
    """Read what ``--set`` sets; refuse fields that the benchmark sets."""
    given = parse_overrides(settings)
    for name in given:
        for field, option in TAKEN.items():
            if name == field or name.startswith(f"{field}.") or field.startswith(f"{name}."):
                raise BadInput(f"--set {name}: the benchmark sets this field; use {option}")
    return given


def _check_preset(preset: str, options: Mapping[str, object]) -> None:
    """Refuse an unknown preset, and options that it decides."""
    if preset not in PRESETS:
        raise BadInput(f"--preset {preset}: no such preset; {did_you_mean(preset, list(PRESETS))}")
    for option, value in options.items():
        if value is not None:
            raise BadInput(f"{option}: --preset {preset} says what is run; leave it out, or drop --preset")


def _check_ground(scenario: Scenario, point: float | None) -> None:
    """Refuse ground on which a preset's robots do not fit: all its runs have the same ground and starts."""
    from patrol.prepare import prepare  # here: it imports kernels

    try:
        prepare(scenario)
    except BadInput as error:
        remedy = "" if point is None else f"; with --point {point:g} walls take more room: give less"
        raise BadInput(f"{error}{remedy}") from None


def _write(folder: Path, matrix: Matrix, results: BenchmarkResults, preset: str | None) -> None:
    from experiments.benchmark.page import drawings, page
    from monitor.report.document import write_page

    chosen = None if preset is None else PRESETS[preset]
    command = command_line("benchmark")
    write_text(folder / "runs.csv", run_rows(results).csv())
    write_text(folder / "cells.csv", cases_table(cell_rows(results)).csv())
    text = markdown.page(matrix, results, command=command, computing_s=results.outcome.computing_s, preset=chosen)
    write_text(folder / "benchmark.md", text)
    drawn = drawings(matrix, results)
    write_page(page(matrix, results, drawn, command=command, preset=chosen), folder / "benchmark.html")
    for drawing in drawn:
        drawing.save(folder / "figures")


def _print(console: Console, results: BenchmarkResults, preset: str | None) -> None:
    """Print the late MFoW of each policy by terrain, for each team and condition."""
    tables: list[Titled] = []
    for team, condition, cells in results.groups:
        table = policy_table(cells)
        shown = 1 + len({result.cell.terrain.name for result in cells})
        title = f"MFoW of the second half (s), {describe(team, condition)}"
        tables.append((title, table.heads[:shown], [row[:shown] for row in table.rows]))
    if preset is not None:
        tables += _published_tables(PRESETS[preset], results)
    for title, heads, rows in tables:
        console.print(title, highlight=False, markup=False, soft_wrap=True)
        grid = Table(*heads, box=None, pad_edge=False, header_style="cyan")
        for column in grid.columns:
            column.overflow = "fold"
        for column in grid.columns[1:]:
            column.justify = "right"
        for row in rows:
            grid.add_row(*row)
        console.print(grid, highlight=False, markup=False)


def _published_tables(preset: Preset, results: BenchmarkResults) -> Iterator[Titled]:
    """Yield a table for each measure, narrow enough for a terminal: its title, headings and rows."""
    beside = beside_published(preset, results.cells)
    named = [0, 1, 2] if len(preset.conditions) > 1 else [0, 2]
    for number, measure in enumerate(preset.measures):
        values = [3 + 2 * number, 4 + 2 * number]
        shown = [[row[at] for at in named + values] for row in beside.rows if any(row[at] != "-" for at in values)]
        title = f"{measure.title}, beside {preset.title}"
        yield title, [*(beside.heads[at] for at in named), "theirs", "ours"], shown


def _default(value: T | None, default: T) -> T:
    return default if value is None else value
