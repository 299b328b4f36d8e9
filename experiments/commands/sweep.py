"""``fogwatch sweep``: many runs, the numbers of each kept. Raises BadInput; the caller prints it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from experiments.sweeps.cases import (
    LATEX,
    SHOWN,
    CaseRow,
    case_rows,
    comparison_lines,
    latex_heads,
    shown_table,
    told_apart,
    write_tables,
)
from experiments.sweeps.plan import Plan, read_plan
from experiments.sweeps.progress import SweepProgress, print_failures
from experiments.sweeps.runner import SweepOutcome, run_sweep
from experiments.sweeps.workers import ClusterWorkers, LocalWorkers
from fogwatch.cli.columns import UNLIMITED, fits
from fogwatch.cli.command_help import command
from fogwatch.cli.options import option
from fogwatch.own_classes import find_classes
from fogwatch.terminal.live_table import duration_text
from monitor.figures.style import WIDTH
from monitor.tables.table import Table as Shown
from patrol.errors import BadInput
from patrol.extras import check_matplotlib
from patrol.scenario.assumptions import assumption_lines

FAILED = 1
"""The exit code when some of the runs failed."""

MM_PER_INCH = 25.4
LEAST_WIDTH_MM = 60.0

EXIT_CODES = "0 every run has a result, 1 some runs failed, 2 bad input, 130 interrupted"


def out_option(default: str) -> Any:
    """Return the option ``--out`` of a command that makes runs."""
    return option("DIR", f"Folder of the results, new and earlier ones (default: {default}).")


@dataclass(frozen=True)
class Machines:
    """The processes that make the runs, of this machine or of a cluster."""

    workers: Annotated[int | None, option("N", "Runs at a time (default: one per core).")] = None
    cluster: Annotated[str | None, option("ADDRESS", "Run on the workers of this Dask scheduler, tcp://HOST:8786.")] = (
        None
    )

    def __post_init__(self) -> None:
        """Refuse a number of workers with a cluster, which has its own."""
        if self.workers is not None and self.cluster is not None:
            raise BadInput("--workers and --cluster: a cluster has its own workers; give only one of the two")

    def make_runs(self, plan: Plan, folder: Path, console: Console, assumed: Sequence[str] = ()) -> SweepOutcome:
        """Make a plan's runs with a progress bar, after the lines `assumed`.

        Results are kept in `folder` and looked for there: after Ctrl-C, the next start continues.
        """
        pool = LocalWorkers(self.workers) if self.cluster is None else ClusterWorkers(self.cluster)
        with SweepProgress(console, assumed=assumed) as progress:
            try:
                return run_sweep(plan, folder, workers=pool, observer=progress, say=progress.say)
            except KeyboardInterrupt:
                if progress.total:
                    count_text = f"{progress.done} of {progress.total} runs are done"
                    progress.say(f"{count_text}; start again to continue in {folder}")
                raise


def finish(console: Console, outcome: SweepOutcome, files: str) -> int:
    """Print how many runs were made, those that failed, and where all files are; return the exit code."""
    print_failures(console, outcome)
    count_text = f"{outcome.made} runs made in {duration_text(outcome.wall_s)}"
    console.print(f"{count_text}; {files}", highlight=False, markup=False, soft_wrap=True)
    return FAILED if outcome.failed else 0


@command(examples=["fogwatch sweep examples/sweeps/dilatation.yaml --seeds 5"], exit_codes=EXIT_CODES)
def sweep(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="Sweep file, YAML with base, grid, cases, seeds, against.")
    ],
    out: Annotated[Path | None, out_option("runs/NAME")] = None,
    *,
    machines: Machines,
    seeds: Annotated[int | None, option("K", "Use seeds 1 to K instead of the file's.")] = None,
    figure_width: Annotated[
        float | None,
        option("MM", "Draw figures exactly so wide, without captions, for a paper: 88 is a column of many journals."),
    ] = None,
    table: Annotated[
        str, option("COLUMNS", f"Columns of table.tex beside the cases: of {', '.join(SHOWN)}, change, p and runs.")
    ] = LATEX,
) -> int:
    """Run a scenario with every combination of some settings and every seed, and tabulate and draw the results.

    The folder gets sweep.md (a page with tables and figures), summary.csv (a row a case), table.tex (for a
    paper in LaTeX), runs.csv (a row a run), comparisons.csv (paired tests of the cases that `against` compares)
    and figures/ as PNG, SVG and PDF. Runs that have a result there are not repeated, so that an interrupted sweep
    continues when it is started again.
    """
    check_matplotlib("experiments")  # before hours of runs, not after them
    width = _width_inches(figure_width)
    latex_heads(table)  # refuses unknown columns before the runs
    plan = read_plan(file, seeds)
    find_classes(run.scenario for run in plan.runs)
    folder = out or Path("runs") / file.stem
    console = Console()
    assumed = [f"{plan.runs[0].case}: {line}" for line in assumption_lines(plan.runs[0].scenario)]
    if len(steps := sorted({run.scenario.step for run in plan.runs if "step" in run.scenario.assumed})) > 1:
        texts = ", ".join(f"{step:g}" for step in steps)
        assumed.append(f"automatic steps differ: {texts} s; for one step in all cases, set step: {steps[0]:g} in base")
    outcome = machines.make_runs(plan, folder, console, assumed)
    for line in () if outcome.made else assumed:
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    write_tables(outcome, folder, table)
    rows = case_rows(outcome)
    _write_page(outcome, rows, folder / "sweep.md", width)
    print_cases(console, rows)
    print_failures(console, outcome)
    compared = ", comparisons.csv" if plan.partners else ""
    for line in (*comparison_lines(rows), *plan.notes):
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    here = f"{len(outcome.plan.runs)} runs, {outcome.made} made now in {duration_text(outcome.wall_s)}"
    files = f"{folder}: sweep.md, summary.csv, table.tex, runs.csv{compared}, figures"
    console.print(f"{here}; {files}", highlight=False, soft_wrap=True)
    return FAILED if outcome.failed else 0


def _width_inches(figure_width_mm: float | None) -> float:
    """Return the width of figures in inches: that of a report's charts, or a narrower one that was asked for."""
    if figure_width_mm is None:
        return WIDTH
    if not LEAST_WIDTH_MM <= figure_width_mm <= WIDTH * MM_PER_INCH:
        raise BadInput(
            f"--figure-width {figure_width_mm:g}: expected {LEAST_WIDTH_MM:g} to {WIDTH * MM_PER_INCH:.0f} mm; a "
            "column of a paper has about 88"
        )
    return figure_width_mm / MM_PER_INCH


def _write_page(outcome: SweepOutcome, rows: list[CaseRow], file: Path, width: float) -> None:
    """Write the page of a sweep with its figures, so many inches wide."""
    from experiments.sweeps.figures import drawings  # here: its library is an extra
    from experiments.sweeps.page import page_head, write_page

    names, shared = told_apart({row.case: row.words for row in rows})
    parts = [*page_head(outcome.plan.name, outcome, "sweep"), *([f"All cases: {shared}."] if shared else [])]
    parts += [shown_table(rows, names).markdown(), *comparison_lines(rows)]
    write_page(file, parts, drawings(rows, outcome.plan.name, width))


LONGEST_WORD = 24
"""Characters of a word of a case's name on a narrow terminal, at most."""


def print_cases(console: Console, rows: list[CaseRow]) -> None:
    """Print the cases' means as a table.

    Words that all cases have in their names are printed once, above the table. On a narrow terminal intervals stand
    below the means, and the words of a name below each other, long ones cut short.
    """
    names, shared = told_apart({row.case: row.words for row in rows})
    if shared:
        console.print(f"all cases: {shared}", highlight=False, markup=False, soft_wrap=True)
    shown = shown_table(rows, names)
    table = _cases_table(shown, " ")
    if not fits(table, console):
        cut = {case: re.sub(rf"(\S{{{LONGEST_WORD - 1}}})\S{{2,}}", r"\1…", name) for case, name in names.items()}
        console, table = Console(file=console.file, width=UNLIMITED), _cases_table(shown_table(rows, cut), "\n")
    console.print(table, highlight=False, markup=False)


def _cases_table(shown: Shown, between: str) -> Table:
    """Return the table of the cases' means; `between` separates a mean from its interval: a space or a line break."""
    narrow = between == "\n"
    table = Table(box=None, pad_edge=False, header_style="cyan", padding=(0, 1 if narrow else 2, 0, 0))
    for column, title in enumerate(shown.heads):
        head, *unit = title.rsplit(" ", 2) if column in shown.numbers else title.split()
        name = between.join([head, " ".join(unit)]) if unit else head
        table.add_column(name, justify="right" if column in shown.numbers else "left")
    for row in shown.rows:
        table.add_row(*(cell.replace(" ", between) for cell in row))
    return table
