"""``fogwatch benchmark``: policies beside each other, on a page. Raises BadInput; the caller prints it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, TypeVar

from rich.console import Console
from rich.table import Table

from experiments.benchmark import markdown
from experiments.benchmark.conditions import ALL, NONE
from experiments.benchmark.matrix import Matrix, plan_of, read_conditions, read_policies, read_teams, read_terrains
from experiments.benchmark.presets import PRESETS, Preset, beside_published, preset_matrix
from experiments.benchmark.results import BenchmarkResults, cell_rows, describe, policy_table, results_of, run_rows
from experiments.commands.sweep import EXIT_CODES, Machines, finish, out_option
from experiments.sweeps.cases import cases_table, write_text
from experiments.sweeps.plan import count_of_seeds
from experiments.sweeps.progress import command_line
from fogwatch.cli.command_help import command
from fogwatch.cli.options import option
from fogwatch.own_classes import find_classes
from fogwatch.run_options import settings_option
from patrol.errors import BadInput, did_you_mean
from patrol.extras import check_matplotlib
from patrol.pose import MODELS
from patrol.scenario import BUILTINS, Scenario, parse_overrides
from patrol.scenario.policies import LEARNED

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

_varied, _of_run, _published = (
    partial(option, panel=panel) for panel in ("What is compared", "Each run", "Published numbers")
)


@dataclass(frozen=True)
class Comparison:
    """The policies, terrains, teams and conditions to compare, and the settings of each run."""

    policies: Annotated[
        str | None,
        _varied(
            "NAME,...",
            "Policies, each NAME, NAME:OPTION=VALUE or ./file.py:Class (default: all built-in ones). Here --patrol "
            "paper is potential-field, and --patrol tour is committed; tour is a cyclic strategy.",
        ),
    ] = None
    terrains: Annotated[
        str | None,
        _varied(
            "NAME,...",
            "Built-in terrains, maps (MAP.yaml), or graphs with either (FILE.graph+MAP.yaml) (default: "
            f"{','.join(BUILTINS)}).",
        ),
    ] = None
    teams: Annotated[str | None, _varied("N,...", f"Numbers of robots (default: {TEAM}).")] = None
    conditions: Annotated[
        str | None,
        _varied(
            "NAME,...", f"Of {', '.join(ALL)}; loss-P and jitter-P for any percentage, A+B for both (default: {NONE})."
        ),
    ] = None
    seeds: Annotated[int | None, _of_run("K", f"Run each cell with seeds 1 to K (default: {SEEDS}).")] = None
    duration: Annotated[float | None, _of_run("S", f"Simulated time in s (default: {DURATION_S:g}).")] = None
    point: Annotated[float | None, _of_run("M", f"Side of one grid point in m (default: {POINT_M:g}).")] = None
    model: Annotated[str | None, _of_run("|".join(MODELS), f"Body model (default: {MODEL}).")] = None
    settings: Annotated[
        list[str] | None, settings_option("Set another field of every run. Repeatable.", panel="Each run")
    ] = None
    quick: Annotated[
        bool,
        _of_run(
            "",
            f"A first impression in minutes: {QUICK_SEEDS} seeds, {QUICK_DURATION_S:g} s, points of {QUICK_POINT_M:g} "
            "m, unless given.",
            "--quick",
        ),
    ] = False
    preset: Annotated[
        str | None, _published("|".join(PRESETS), "The conditions of published numbers, which are shown beside ours.")
    ] = None
    map: Annotated[Path | None, _published("FILE", "With --preset: cumberland.yaml.")] = None
    graph: Annotated[Path | None, _published("FILE", "With --preset: cumberland.graph.")] = None

    def matrix(self) -> Matrix:
        """Return all cells."""
        overrides = _read_overrides(self.settings or [])
        policies = self.policies
        if policies is None:
            from agent.policies.found import POLICIES  # here: loads much

            policies = ",".join(name for name in POLICIES.built_in if name != LEARNED)  # which needs a network
        chosen = read_policies(policies)
        numbers = count_of_seeds(_or_default(self.seeds, QUICK_SEEDS if self.quick else SEEDS))
        if self.preset is not None:
            self._check_preset(self.preset)
            settings = overrides if self.point is None else {"point": self.point, **overrides}
            return preset_matrix(self.preset, chosen, numbers, self.map, self.graph, settings)
        for name, file in (("--map", self.map), ("--graph", self.graph)):
            if file is not None:
                raise BadInput(f"{name} {file}: goes with --preset; give --terrains FILE.graph+MAP.yaml instead")
        point = _or_default(self.point, QUICK_POINT_M if self.quick else POINT_M)
        return Matrix(
            chosen,
            read_terrains(",".join(BUILTINS) if self.terrains is None else self.terrains),
            read_teams(str(TEAM) if self.teams is None else self.teams),
            read_conditions(NONE if self.conditions is None else self.conditions),
            numbers,
            _or_default(self.duration, QUICK_DURATION_S if self.quick else DURATION_S),
            {"point": point, "robots.model": self.model or MODEL, **overrides},
        )

    def _check_preset(self, preset: str) -> None:
        """Refuse an unknown preset, and options that it decides."""
        if preset not in PRESETS:
            raise BadInput(f"--preset {preset}: no such preset; {did_you_mean(preset, list(PRESETS))}")
        for name in ("terrains", "teams", "conditions", "duration", "model", "quick"):
            if getattr(self, name) not in (None, False):
                raise BadInput(f"--{name}: --preset {preset} says what is run; leave it out, or drop --preset")


@command(
    examples=[
        "fogwatch benchmark --quick",
        "fogwatch benchmark --terrains yards,site --policies stochastic,sebs --conditions none,loss-90,deaths",
        "fogwatch benchmark --policies stochastic,stochastic:unpredictability=2,./mine.py:Mine --teams 2,4,8",
        "fogwatch benchmark --terrains plan.yaml --model differential --set robots.radius=0.3 --set robots.speed=1",
        "fogwatch benchmark --preset m2bench --map cumberland.yaml --graph cumberland.graph",
    ],
    exit_codes=EXIT_CODES,
)
def benchmark(
    compared: Comparison, out: Annotated[Path | None, out_option("runs/benchmark")] = None, *, machines: Machines
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
    matrix, preset = compared.matrix(), compared.preset
    plan = plan_of(matrix)
    find_classes(run.scenario for run in plan.runs)
    if preset is not None:
        _check_ground(plan.runs[0].scenario, compared.point)
    check_matplotlib("experiments")  # before hours of runs, not after them
    folder = out or Path("runs") / "benchmark"
    outcome = machines.make_runs(plan, folder, console)
    results = results_of(matrix, outcome)
    _print_results(console, results, preset)
    _write_results(folder, matrix, results, preset)
    files = f"{folder}: benchmark.html has all results; also benchmark.md, cells.csv, runs.csv, figures"
    return finish(console, outcome, files)


def _read_overrides(settings: Sequence[str]) -> dict[str, object]:
    """Read the settings of ``--set``; refuse fields that the benchmark sets."""
    overrides = parse_overrides(settings)
    for name in overrides:
        for field, taken_by in TAKEN.items():
            if name == field or name.startswith(f"{field}.") or field.startswith(f"{name}."):
                raise BadInput(f"--set {name}: the benchmark sets this field; use {taken_by}")
    return overrides


def _check_ground(scenario: Scenario, point: float | None) -> None:
    """Refuse ground on which a preset's robots do not fit: all its runs have the same ground and starts."""
    from patrol.prepare import prepare  # here: it imports kernels

    try:
        prepare(scenario)
    except BadInput as error:
        remedy = "" if point is None else f"; with --point {point:g} walls take more room: give less"
        raise BadInput(f"{error}{remedy}") from None


def _write_results(folder: Path, matrix: Matrix, results: BenchmarkResults, preset: str | None) -> None:
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


def _print_results(console: Console, results: BenchmarkResults, preset: str | None) -> None:
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
        shown = [
            [row[column] for column in named + values]
            for row in beside.rows
            if any(row[column] != "-" for column in values)
        ]
        title = f"{measure.title}, beside {preset.title}"
        yield title, [*(beside.heads[column] for column in named), "theirs", "ours"], shown


def _or_default(value: T | None, default: T) -> T:
    return default if value is None else value
