"""``fogwatch reproduce faults``: what each kind of fault costs. Raises BadInput; the caller prints it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from rich.console import Console
from rich.table import Table

from experiments.commands.reproduce import app
from experiments.commands.sweep import EXIT_CODES, Machines, finish, out_option
from experiments.faults.cost import (
    GROUPS,
    VARIANTS,
    FaultSetup,
    Finding,
    as_json,
    chosen,
    comparisons,
    findings,
    plan_of,
)
from experiments.faults.cost_page import page
from experiments.faults.figures import costs_picture, curves_picture
from experiments.sweeps.cases import json_text, write_tables, write_text
from experiments.sweeps.plan import count_of_seeds
from experiments.sweeps.progress import command_line
from experiments.sweeps.stats import with_interval
from fogwatch.cli.command_help import command
from fogwatch.cli.options import option
from fogwatch.run_options import settings_option
from patrol.errors import BadInput
from patrol.scenario import parse_overrides

VARIED = sorted({field for settings in VARIANTS.values() for field in settings})
TAKEN = ("faults", *VARIED, "terrain", "point", "duration", "robots.count", "seed", "nemesis")
"""Fields that the experiment sets."""

KEY = "the key of this experiment"
"""The content of the fleet's key, always the same, because robots draw from it."""


@command(
    app,
    examples=["fogwatch reproduce faults --seeds 1 --only loss,death", "fogwatch reproduce faults --workers 4"],
    exit_codes=EXIT_CODES,
)
def faults(
    point: Annotated[float, option("M", "Side of one grid point in m.")] = 1.0,
    seeds: Annotated[int, option("K", "Run each condition with seeds 1 to K.")] = 3,
    duration: Annotated[float, option("S", "Simulated time of each run in s.")] = 5000.0,
    robots: Annotated[int, option("N", "Number of robots.")] = 5,
    terrain: Annotated[str, option("NAME", "Built-in terrain.")] = "yards",
    only: Annotated[
        str | None,
        option("NAME,...", f"Run only these groups ({', '.join(GROUPS)}) or conditions, such as 'loss: 50 % lost'."),
    ] = None,
    settings: Annotated[list[str] | None, settings_option("Set a field of every run. Repeatable.")] = None,
    out: Annotated[Path | None, out_option("runs/faults")] = None,
    *,
    machines: Machines,
) -> int:
    """Measure what each kind of fault costs the paper's final algorithm, without and with claims.

    The faults are: frames lost independently, in bursts, or with the last positions sent along; silence; deaths,
    restarts and robots that join; a partition; a short radio range; forged positions. Robots give way and cars make
    random steps; set patrol.give_way=false to follow the paper more closely.

    The folder gets faults.md with all results, faults.json, the runs' numbers as CSV and JSON, and pictures. Runs that
    have a result there are not repeated.
    """
    console = Console()
    folder = out or Path("runs") / "faults"
    overrides = parse_overrides(settings or [])
    if reserved := [name for name in overrides if name.split(".")[0] in TAKEN or name in TAKEN]:
        raise BadInput(f"--set {reserved[0]}: the experiment sets this field; leave it out, or use an option")
    numbers = count_of_seeds(seeds)
    setup = FaultSetup(terrain, point, duration, robots, numbers, (folder / "fleet.key").resolve(), overrides)
    tried = chosen(setup, [name.strip() for name in only.split(",")] if only else [])
    plan = plan_of(setup, tried)
    if not setup.key.exists():
        write_text(setup.key, KEY)
    outcome = machines.make_runs(plan, folder, console)
    measured, compared = findings(outcome, tried), comparisons(outcome, tried)
    _print_findings(console, measured)
    write_tables(outcome, folder)
    write_text(folder / "faults.json", json_text(as_json(setup, measured, compared)))
    pictures = [
        name
        for name, draw in (("loss", curves_picture), ("costs", costs_picture))
        if draw(measured, [folder / f"{name}.png", folder / f"{name}.svg"])
    ]
    made_by = command_line("reproduce", "faults")
    shown = [f"{name}.png" for name in pictures]
    spent, failed = outcome.computing_s, len(outcome.failed)
    text = page(setup, measured, compared, command=made_by, computing_s=spent, failed=failed, pictures=shown)
    write_text(folder / "faults.md", text)
    return finish(console, outcome, f"{folder}: faults.md has all results")


def _print_findings(console: Console, found: Sequence[Finding]) -> None:
    table = Table("", "variant", "MFoW (s)", "cost", "late (s)", "belief error (s)", box=None, header_style="cyan")
    for column in table.columns[2:]:
        column.justify = "right"
    for finding in sorted(found, key=lambda finding: list(GROUPS).index(finding.condition.group)):
        cost = "-" if finding.cost is None else f"{finding.cost.mean:.3f}"
        numbers = (with_interval(finding.mfow), cost, with_interval(finding.late), with_interval(finding.belief))
        table.add_row(f"{finding.condition.group}: {finding.condition.name}", finding.variant, *numbers)
    console.print(table, highlight=False, markup=False)
