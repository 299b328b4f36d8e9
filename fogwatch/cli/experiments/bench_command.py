"""``fogwatch bench``: how fast fogwatch is on this machine. Raises BadInput; the caller prints it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from experiments.bench.tools.groups import ALL, GROUPS
from experiments.bench.tools.machine import Machine, this_machine
from experiments.bench.tools.measure import QUICK, THOROUGH, Finding, Task, most_of_others, take
from experiments.bench.tools.others import OthersWork
from experiments.bench.tools.results import as_json, check_page, page, table_of
from experiments.sweeps.casetable import json_text, write_text
from fogwatch.progress import command_line
from patrol.process.exit_codes import INTERRUPTED
from patrol.process.lifeline import heed
from patrol.process.starting.seldom import SELDOM
from patrol.process.starting.warmup import warm

FAILED = 1
"""The exit code when a measure could not be taken."""

PACKAGES = ("patrol", "agent", "worldsim")

EXAMPLES = [
    "fogwatch bench kernels decisions --quick",
    "fogwatch bench fleets --only '200 robots'",
    "fogwatch bench all --json speed.json --markdown docs/results/speed.md --markdown docs/scale.md",
]
EXIT_CODES = "0 all was measured, 1 something could not be, 2 bad input, 130 interrupted (what was measured is kept)"


def bench(
    groups: Annotated[
        list[str] | None,
        typer.Argument(metavar="[GROUP]...", help=f"What to measure: {', '.join(GROUPS)}, or {ALL} (default)."),
    ] = None,
    only: Annotated[
        str, typer.Option(metavar="TEXT", help="Only measures whose name contains this.", show_default=False)
    ] = "",
    quick: Annotated[bool, typer.Option("--quick", help="Few readings, short runs, small fleets.")] = False,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="Write every reading as JSON.")] = None,
    markdown: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE", help="Write tables; in a page that exists, between its marks of a group. Repeatable."
        ),
    ] = None,
) -> int:
    """Measure how fast fogwatch is: kernels, decisions, fleets, start-up, memory.

    The kernels run in turn with other libraries that do the same, as far as they are installed (the extra "bench", or
    make rivals), and their results are compared. Times are processor times unless the unit or the name says otherwise.
    Nothing else should run on the machine.
    """
    from experiments.bench.suite import chosen

    heed(None, patience=0)  # every signal ends it in order, with the fleets that it has started
    console = Console()
    tasks = chosen(groups or [], only)
    for path in markdown or ():
        check_page(path, [task.group for task in tasks])
    machine = this_machine()
    for line in machine.lines:
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    if machine.busy:
        console.print(machine.warning, style="red", highlight=False, markup=False, soft_wrap=True)
    warm(PACKAGES, lambda line: console.print(line, highlight=False, markup=False), SELDOM)
    findings: list[Finding] = []
    interrupted = False
    show = _Progress(console, len(tasks), findings)
    try:
        with console.status("measuring", spinner="line") as status:
            effort, others = QUICK if quick else THOROUGH, OthersWork()
            take(tasks, effort, lambda task: status.update(show.begin(task)), show.done, others.cores)
    except KeyboardInterrupt:
        interrupted = True
        console.print(f"interrupted; {len(findings)} of {len(tasks)} are kept", style="red", highlight=False)
    if doubts := machine.doubts(most_of_others(findings)):
        console.print(doubts, style="red", highlight=False, markup=False, soft_wrap=True)
    _write(machine, findings, json, markdown or ())
    if interrupted:
        return INTERRUPTED
    return FAILED if any(finding.failure for finding in findings) else 0


class _Progress:
    """Prints each result as it comes."""

    def __init__(self, console: Console, total: int, findings: list[Finding]) -> None:
        self._console, self._total, self._findings = console, total, findings
        self._begun = 0

    def begin(self, task: Task) -> str:
        self._begun += 1
        return f"{self._begun} of {self._total}: {task.group}: {task.name}"

    def done(self, finding: Finding) -> None:
        self._findings.append(finding)
        title = f"{finding.task.group}: {finding.task.name}"
        if finding.failure:
            self._console.print(f"{title}: not measured: {finding.failure}", style="red", highlight=False, markup=False)
            return
        heads, rows = table_of(finding.measures)
        self._console.print(title, style="bold", highlight=False, markup=False, soft_wrap=True)
        table = Table(*heads[:-1], box=None, pad_edge=False, header_style="cyan")
        for column in table.columns[2:]:
            column.justify = "right"
        for row in rows:
            table.add_row(*row[:-1])
        self._console.print(table, highlight=False, markup=False)
        for name, says in ((row[0], row[-1]) for row in rows if row[-1]):
            self._console.print(f"  {name}: {says}", style="dim", highlight=False, markup=False, soft_wrap=True)


def _write(machine: Machine, findings: list[Finding], json: Path | None, pages: Sequence[Path]) -> None:
    made_by = command_line("bench")
    if json is not None:
        write_text(json, json_text(as_json(machine, made_by, findings)))
    for path in pages if findings else ():
        write_text(path, page(path, machine, made_by, findings))
