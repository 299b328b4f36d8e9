"""``fogwatch reproduce``: the paper's tables and claims. Raises BadInput; the caller prints it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from experiments.commands.sweep import EXIT_CODES, Machines, finish, out_option
from experiments.paper.printed import paper
from experiments.sweeps.cases import case_rows, write_tables, write_text
from experiments.sweeps.plan import count_of_seeds
from fogwatch.cli.command_help import command, group
from fogwatch.cli.options import option
from fogwatch.run_options import settings_option
from patrol.extras import check_matplotlib
from patrol.scenario import parse_overrides
from patrol.scenario.policies import TO_THE_LETTER

if TYPE_CHECKING:
    from experiments.sweeps.plan import Plan

app = group("reproduce", "Reproduce the paper's tables, or one of its claims.")

CLAIM_S = 2000
"""Simulated time of the runs of one claim, s: minutes of computing."""

EACH_CELL = "Set a field of every cell, such as point=0.1."
TO_LETTER = "Follow the paper to the letter: letter=true and ties=drawn in every cell."


@command(app, examples=["fogwatch reproduce table 2 3 --seeds 1", "fogwatch reproduce table"], exit_codes=EXIT_CODES)
def table(
    numbers: Annotated[
        list[int] | None, typer.Argument(metavar="N...", help="Numbers of tables, 2 to 8 (default: all).")
    ] = None,
    seeds: Annotated[int, option("K", "Run each cell with seeds 1 to K.")] = 3,
    rows: Annotated[str | None, option("NAME,...", "Run only these rows.")] = None,
    columns: Annotated[str | None, option("NAME,...", "Run only these columns.")] = None,
    settings: Annotated[list[str] | None, settings_option(EACH_CELL)] = None,
    letter: Annotated[bool, option("", TO_LETTER, "--letter")] = False,
    out: Annotated[Path | None, out_option("runs/paper; runs/paper-letter")] = None,
    *,
    machines: Machines,
) -> int:
    """Run tables of the paper, show our values beside the printed ones, and test the paper's claims on them.

    The folder gets paper.md with all of it, cells.csv, claims.csv, the tables of a sweep, and figures. Runs that have a
    result there are not repeated.
    """
    from experiments.paper.tables import plan_of

    title, words = "The paper's tables, side by side", ["table", *map(str, numbers or ())]
    chosen = list(dict.fromkeys(numbers or paper().tables))
    names = [part.split(",") if part else [] for part in (rows, columns)]
    overrides = {**(TO_THE_LETTER if letter else {}), **parse_overrides(settings or [])}
    plan = plan_of(chosen, count_of_seeds(seeds), overrides, *names)
    return _make(plan, overrides, title, words, out or Path("runs") / ("paper-letter" if letter else "paper"), machines)


@command(app, examples=["fogwatch reproduce claim", "fogwatch reproduce claim goal-refinement"], exit_codes=EXIT_CODES)
def claim(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="Name of the claim (default: list them).")] = None,
    seeds: Annotated[int, option("K", "Run each cell with seeds 1 to K.")] = 3,
    settings: Annotated[list[str] | None, settings_option(EACH_CELL)] = None,
    letter: Annotated[bool, option("", TO_LETTER, "--letter")] = False,
    out: Annotated[Path | None, out_option("runs/claim-NAME; runs/claim-NAME-letter")] = None,
    *,
    machines: Machines,
) -> int:
    """Test one claim of the paper: does it hold, fail, or is it undecided?

    Runs the cells that the claim compares for 2000 s each, some minutes on two cores, and prints the ratio of the two
    sides with its 95 % interval, beside that of the printed values. The folder gets what `reproduce table` writes.
    """
    from experiments.paper.tables import plan_of
    from experiments.sweeps.page import print_page
    from monitor.tables.table import Table

    if name is None:
        rows = [(name, claim.says) for name, claim in paper().claims.items()]
        print_page(Console(), [Table(("claim", "the paper says"), rows).markdown()])
        return 0
    tested = paper().claim(name)
    overrides = {"duration": CLAIM_S, **(TO_THE_LETTER if letter else {}), **parse_overrides(settings or [])}
    chosen = list(dict.fromkeys((tested.lower.table, tested.higher.table)))
    plan = plan_of(chosen, count_of_seeds(seeds), overrides, claim=tested)
    folder = out or Path("runs") / (f"claim-{name}-letter" if letter else f"claim-{name}")
    return _make(plan, overrides, f"The paper's claim {name}", ["claim", name], folder, machines)


def _make(
    plan: Plan, overrides: Mapping[str, object], title: str, words: Sequence[str], folder: Path, machines: Machines
) -> int:
    """Make the runs of a plan, print and write what they show, and return the exit code."""
    check_matplotlib("experiments")  # before hours of runs, not after them
    from experiments.paper.claims import claims_section, claims_table
    from experiments.paper.tables import cells_of, cells_table, page_parts, table_drawings
    from experiments.sweeps.page import page_head, print_page, write_page

    console = Console()
    outcome = machines.make_runs(plan, folder, console)
    cases = case_rows(outcome)
    cells = cells_of(cases)
    claims = claims_table(cells)
    head = page_head(title, outcome, "reproduce", *words)
    parts = [*head, *page_parts(cells, overrides, plan.seeds), *claims_section(claims)]
    print_page(console, parts)
    write_tables(outcome, folder)
    write_text(folder / "cells.csv", cells_table(cells).csv())
    write_text(folder / "claims.csv", claims.csv())
    write_page(folder / "paper.md", parts, table_drawings(cases, cells))
    return finish(
        console,
        outcome,
        f"{folder}: paper.md has all results; also cells.csv, claims.csv, summary.csv, runs.csv, figures",
    )
