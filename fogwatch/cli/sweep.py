"""``fogwatch sweep``: many runs, the numbers of each kept. Raises BadInput; the caller prints it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from experiments.sweeps.casetable import CaseRow, case_rows, write_tables
from experiments.sweeps.cluster import ClusterWorkers
from experiments.sweeps.plan import Plan, read_plan
from experiments.sweeps.pool import LocalWorkers, WorkerPool
from experiments.sweeps.runner import SweepOutcome, run_sweep
from experiments.sweeps.stats import Estimate
from fogwatch.progress import SweepProgress, duration, print_failures
from patrol.errors import BadInput
from patrol.scenario.policy_file import PAPER

FAILED = 1
"""The exit code when some of the runs failed."""

SHOWN = {
    "mfow_mean_s": "mean MFoW (s)",
    "mfow_max_s": "largest MFoW (s)",
    "fog_mean_s": "mean fog (s)",
    "dead_end_percent": "dead ends (%)",
    "collisions": "collisions",
}
"""Metrics in the table on the terminal; the files have all of them."""

Workers = Annotated[
    int | None,
    typer.Option(metavar="N", help="Runs at a time (default: one per core).", show_default=False),
]
ClusterAddress = Annotated[
    str | None,
    typer.Option("--cluster", metavar="ADDRESS", help="Run on the workers of this Dask scheduler, tcp://HOST:8786."),
]

EXAMPLES = ["fogwatch sweep examples/sweeps/dilatation.yaml --seeds 5"]
EXIT_CODES = "0 every run has a result, 1 some runs failed, 2 bad input, 130 interrupted"


def sweep(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="Sweep file, YAML with base, grid, cases, seeds, against.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder of the results, new and earlier ones (default: runs/NAME)."),
    ] = None,
    workers: Workers = None,
    cluster: ClusterAddress = None,
    seeds: Annotated[
        int | None, typer.Option(metavar="K", help="Use seeds 1 to K instead of the file's.", show_default=False)
    ] = None,
) -> int:
    """Run a scenario with every combination of some settings and every seed, and tabulate the results.

    Runs that have a result in the folder are not repeated, so that an interrupted sweep continues when it is started
    again.
    """
    plan = read_plan(file, seeds)
    _check_policies(plan)
    folder = out or Path("runs") / file.stem
    console = Console()
    outcome = make_runs(plan, folder, workers_of(workers, cluster), console)
    as_csv, as_json = write_tables(outcome, folder)
    print_cases(console, case_rows(outcome))
    print_failures(console, outcome)
    here = f"{len(outcome.plan.runs)} runs, {outcome.made} made now in {duration(outcome.wall_s)}"
    console.print(f"{here}: {as_csv}, {as_json}", highlight=False, soft_wrap=True)
    return FAILED if outcome.failed else 0


def _check_policies(plan: Plan) -> None:
    """Find every policy of one's own, with its options, before any run is made."""
    own = {
        repr((run.scenario.patrol.policy, run.scenario.patrol.options)): run.scenario
        for run in plan.runs
        if run.scenario.patrol.policy != PAPER
    }
    if own:
        from agent.policies.found import policy_of

        for scenario in own.values():
            policy_of(scenario)


def workers_of(workers: int | None, cluster: str | None) -> WorkerPool:
    """The workers that make the runs.

    Args:
        workers: How many processes of this machine; None for one per core.
        cluster: Address of a Dask scheduler whose workers are used instead, or None.

    Raises:
        BadInput: Both are given.
    """
    if cluster is None:
        return LocalWorkers(workers)
    if workers is not None:
        raise BadInput("--workers and --cluster: a cluster has its own workers; give only one of the two")
    return ClusterWorkers(cluster)


def make_runs(
    plan: Plan, folder: Path, workers: WorkerPool, console: Console, estimate_time: bool = False
) -> SweepOutcome:
    """Make a plan's runs with a progress bar. After Ctrl-C, the next start continues.

    Args:
        plan: The runs.
        folder: Where results are kept and looked for.
        workers: Who makes the runs.
        console: Where the progress is shown.
        estimate_time: Whether to try a few runs first, to say how long all will take.

    Returns:
        The results.
    """
    with SweepProgress(console, estimate_time=estimate_time) as progress:
        try:
            return run_sweep(plan, folder, workers=workers, observer=progress, say=progress.say)
        except KeyboardInterrupt:
            if progress.total:
                progress.say(f"{progress.done} of {progress.total} runs are done; start again to continue in {folder}")
            raise


def print_cases(console: Console, rows: list[CaseRow]) -> None:
    """Print the cases' means as a table.

    Args:
        console: Where to print.
        rows: The results case by case.
    """
    shown = {name: title for name, title in SHOWN.items() if any(name in row.metrics for row in rows)}
    compared = any(row.against for row in rows)
    titles = [*shown.values(), *(["change of MFoW (%)"] if compared else [])]
    table = Table("case", "runs", *titles, box=None, pad_edge=False, header_style="cyan")
    for column in table.columns[1:]:
        column.justify = "right"
    if compared:
        table.add_column("compared with")
    for row in rows:
        runs = f"{row.runs}" + (f", {row.failed} failed" if row.failed else "")
        runs += f", {row.warned} with warnings" if row.warned else ""
        change = [with_interval(row.change.get("mfow_mean_s")), row.against or ""] if compared else []
        table.add_row(row.case, runs, *(with_interval(row.metrics.get(name)) for name in shown), *change)
    console.print(table, highlight=False, markup=False)


def with_interval(found: Estimate | None) -> str:
    """A mean and half the width of its 95 % interval, as in "12.3 ±0.4".

    Args:
        found: The mean; None gives "-".
    """
    if found is None:
        return "-"
    return f"{found.mean:.1f}" if found.half is None else f"{found.mean:.1f} ±{found.half:.1f}"
