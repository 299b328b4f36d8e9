"""``fogwatch benchmark``: policies beside each other, on a page. Raises BadInput; the caller prints it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

from rich.console import Console

from experiments.benchmark.conditions import ALL, NONE
from experiments.benchmark.matrix import Matrix, read_conditions, read_policies, read_teams, read_terrains
from experiments.benchmark.presets import Preset, preset_named
from experiments.commands.sweep import EXIT_CODES, Machines, finish, out_option
from experiments.sweeps.cases import case_rows, write_text
from experiments.sweeps.plan import count_of_seeds
from fogwatch.cli.command_help import command
from fogwatch.cli.options import option
from fogwatch.own_classes import find_classes
from fogwatch.run_options import settings_option
from patrol.errors import BadInput
from patrol.extras import check_matplotlib
from patrol.pose import MODELS
from patrol.scenario import BUILTINS, parse_overrides
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

_varied, _of_run = (partial(option, panel=panel) for panel in ("What is compared", "Each run"))


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
            "Built-in terrains, maps (MAP.yaml), or graphs with either (FILE.graph+MAP.yaml) (default: all built-in "
            "ones).",
        ),
    ] = None
    teams: Annotated[str | None, _varied("N,...", f"Numbers of robots (default: {TEAM}).")] = None
    conditions: Annotated[
        str | None, _varied("NAME,...", f"Of {', '.join(ALL)}, with other numbers too, A+B for both (default: {NONE}).")
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
        str | None,
        _varied(
            "NAME",
            "conditions: three policies where a fleet is not ideal. m2bench, m2bench-jitter or magec: conditions of "
            "published numbers, shown beside ours, with --terrains cumberland.graph+cumberland.yaml.",
        ),
    ] = None

    def matrix(self, preset: Preset | None) -> Matrix:
        """Return all cases."""
        overrides = _read_overrides(self.settings or [])
        policies, terrains = self.policies, self.terrains
        if preset is not None:
            policies, terrains = policies or preset.policies, terrains or preset.terrains
        if policies is None:
            from agent.policies.found import POLICIES  # here: loads much

            policies = ",".join(name for name in POLICIES.built_in if name != LEARNED)  # which needs a network
        chosen, grounds = read_policies(policies), read_terrains(terrains or ",".join(BUILTINS))
        usual = (QUICK_SEEDS, QUICK_DURATION_S, QUICK_POINT_M) if self.quick else (SEEDS, DURATION_S, POINT_M)
        count, duration_s, point_m = (
            default if value is None else value
            for value, default in zip((self.seeds, self.duration, self.point), usual, strict=True)
        )
        seeds = count_of_seeds(int(count))
        if preset is not None:
            for name in ("teams", "conditions", "duration", "point", "model", "quick"):
                may_differ = name in ("conditions", "duration", "model") and not preset.published
                if getattr(self, name) not in (None, False) and not may_differ:
                    raise BadInput(f"--{name}: --preset {self.preset} says what is run; leave it out, or drop --preset")
            conditions = None if self.conditions is None else read_conditions(self.conditions)
            of_runs = {"duration": self.duration, "robots.model": self.model}
            overrides.update({name: value for name, value in of_runs.items() if value is not None})
            return preset.matrix(chosen, grounds, seeds, overrides, conditions)
        return Matrix(
            chosen,
            grounds,
            read_teams(str(TEAM) if self.teams is None else self.teams),
            read_conditions(NONE if self.conditions is None else self.conditions),
            seeds,
            duration_s,
            {"point": point_m, "robots.model": self.model or MODEL, **overrides},
        )


@command(
    examples=[
        "fogwatch benchmark --quick",
        "fogwatch benchmark --terrains yards,site --policies stochastic,sebs --conditions none,loss-90,deaths",
        "fogwatch benchmark --policies stochastic,stochastic:unpredictability=2,./mine.py:Mine --teams 2,4,8",
        "fogwatch benchmark --terrains plan.yaml --model differential --set robots.radius=0.3 --set robots.speed=1",
        "fogwatch benchmark --preset conditions --policies stochastic --terrains yards --seeds 1",
        "fogwatch benchmark --preset m2bench --terrains cumberland.graph+cumberland.yaml",
    ],
    exit_codes=EXIT_CODES,
)
def benchmark(
    compared: Comparison, out: Annotated[Path | None, out_option("runs/benchmark")] = None, *, machines: Machines
) -> int:
    """Compare policies on terrains, in teams of several sizes, under faults, and write a page with figures.

    A cell is one policy on one terrain, in one team, under one condition; it is run once with each seed. Conditions are
    none, loss-50 (each frame is lost with 50 %), bursts (50 % are, 8 ticks at a time), delay-3 (frames are 3 s late),
    range-30 (they reach 30 m), silence (no robot hears another), deaths (two robots die at 300 and 1100 s, earlier in
    runs shorter than 1800 s), one-death (one dies at a third of the run), wreck (the same, and it stays there), spoof
    (a stranger sends random positions in the name of r1), sector-90 (the sensor sees 90 degrees ahead), noise-10
    (positions are off by 10 cm), jumps (by 1 m, for 5 s every 60 s), jitter-20 (speeds change every 5 s by up to 20 %),
    slower-5 (r1 is 5 % slower), speeds (from half to 1.25 times the speed), bodies (holonomic, differential, car in
    turn) and robots-26 (so many robots). Cells whose team is too small for their condition are left out.

    The folder gets benchmark.md (tables and figures), runs.csv with the command that makes each run again, cells.csv
    with means and 95 % intervals, and figures/. Runs that have a result there are not repeated, so an interrupted
    benchmark continues when it is started again.
    """
    check_matplotlib("experiments")  # before hours of runs, not after them
    from experiments.benchmark.plane import plane_drawings
    from experiments.benchmark.results import MEASURES, cell_rows, groups_of, page_parts, run_rows, with_ratios
    from experiments.sweeps.figures import MOST_ROWS, drawings
    from experiments.sweeps.page import page_head, print_page, write_page

    console = Console()
    preset = None if compared.preset is None else preset_named(compared.preset)
    matrix = compared.matrix(preset)
    plan = matrix.plan()
    find_classes(run.scenario for run in plan.runs)
    folder = out or Path("runs") / "benchmark"
    outcome = with_ratios(machines.make_runs(plan, folder, console))
    rows = case_rows(outcome)
    parts = [*page_head("Benchmark", outcome, "benchmark"), *page_parts(matrix, rows, preset)]
    print_page(console, parts)
    write_text(folder / "runs.csv", run_rows(outcome).csv())
    write_text(folder / "cells.csv", cell_rows(rows, matrix.seeds[0]).csv())
    drawn = rows if len(rows) <= MOST_ROWS else groups_of(rows)[0][1]
    shown = MEASURES if preset is None or preset.published else {**MEASURES, **preset.measures}
    figures = [*plane_drawings(rows), *drawings(drawn, "benchmark", shown=shown)]
    write_page(folder / "benchmark.md", parts, figures)
    return finish(console, outcome, f"{folder}: benchmark.md has all results; also cells.csv, runs.csv, figures")


def _read_overrides(settings: Sequence[str]) -> dict[str, object]:
    """Read the settings of ``--set``; refuse fields that the benchmark sets."""
    overrides = parse_overrides(settings)
    for name in overrides:
        for field, taken_by in TAKEN.items():
            if name == field or name.startswith(f"{field}.") or field.startswith(f"{name}."):
                raise BadInput(f"--set {name}: the benchmark sets this field; use {taken_by}")
    return overrides
