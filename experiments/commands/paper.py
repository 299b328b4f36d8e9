"""``fogwatch reproduce table``: the paper's tables. Raises BadInput; the caller prints it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

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

app = group("reproduce", "Reproduce the paper's tables.")


@command(app, examples=["fogwatch reproduce table 2 3 --seeds 1", "fogwatch reproduce table"], exit_codes=EXIT_CODES)
def table(
    numbers: Annotated[
        list[int] | None, typer.Argument(metavar="N...", help="Numbers of tables, 2 to 8 (default: all).")
    ] = None,
    seeds: Annotated[int, option("K", "Run each cell with seeds 1 to K.")] = 3,
    rows: Annotated[str | None, option("NAME,...", "Run only these rows.")] = None,
    columns: Annotated[str | None, option("NAME,...", "Run only these columns.")] = None,
    settings: Annotated[list[str] | None, settings_option("Set a field of every cell, such as point=0.1.")] = None,
    letter: Annotated[
        bool,
        option(
            "",
            "Follow the paper to the letter: letter=true, ties=drawn, random_move_for=all in every cell.",
            "--letter",
        ),
    ] = False,
    out: Annotated[Path | None, out_option("runs/paper; runs/paper-letter")] = None,
    *,
    machines: Machines,
) -> int:
    """Run tables of the paper, show our values beside the printed ones, and test the paper's conclusions on them.

    The folder gets paper.md with all of it, cells.csv, the tables of a sweep, and figures. Runs that have a result
    there are not repeated.
    """
    check_matplotlib("experiments")  # before hours of runs, not after them
    from experiments.paper.conclusions import conclusions_section
    from experiments.paper.tables import cells_of, cells_table, page_parts, plan_of, table_drawings
    from experiments.sweeps.page import page_head, print_page, write_page

    console = Console()
    folder = out or Path("runs") / ("paper-letter" if letter else "paper")
    overrides = {**(TO_THE_LETTER if letter else {}), **parse_overrides(settings or [])}
    chosen = list(dict.fromkeys(numbers or paper().tables))
    plan = plan_of(
        chosen, count_of_seeds(seeds), overrides, *(names.split(",") if names else [] for names in (rows, columns))
    )
    outcome = machines.make_runs(plan, folder, console)
    cases = case_rows(outcome)
    cells = cells_of(cases)
    head = page_head("The paper's tables, side by side", outcome, "reproduce", "table", *map(str, numbers or ()))
    parts = [*head, *page_parts(cells, overrides, plan.seeds), *conclusions_section(cells)]
    print_page(console, parts)
    write_tables(outcome, folder)
    write_text(folder / "cells.csv", cells_table(cells).csv())
    write_page(folder / "paper.md", parts, table_drawings(cases, cells))
    return finish(
        console, outcome, f"{folder}: paper.md has all results; also cells.csv, summary.csv, runs.csv, figures"
    )
