"""``fogwatch export``: a run's tables as Parquet or CSV files. Raises BadInput; the caller prints it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fogwatch.cli.runs.open_run import KEY, RUN, open_folder, print_state
from patrol.errors import BadInput, did_you_mean
from patrol.files.untrusted import leads_out
from patrol.printable import printable
from patrol.process.lifeline import heed

EXAMPLES = [
    "fogwatch export runs/yards-20260101-120000 --format parquet",
    "fogwatch export RUN --format csv --out tables",
]
EXIT_CODES = "0 done, 2 bad input, 130 interrupted"
TABLES = "tables"


def export(
    run: Annotated[Path, RUN],
    kind: Annotated[str, typer.Option("--format", metavar="parquet|csv", help="Format of the files.")] = "parquet",
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of the files (default: tables in the run's folder).")
    ] = None,
    key: Annotated[Path | None, KEY] = None,
) -> None:
    """Write a run's tables for pandas, polars or a spreadsheet, a file a table.

    The tables are ticks, robots, links, events, visits (of a graph's vertices) and ground. Files of these names in the
    folder are replaced, all of them or none.
    """
    from rich.console import Console
    from rich.progress import TimeRemainingColumn

    from fogwatch.launch.terminal.bars import bar_on
    from monitor.tables.arrow import check_pyarrow
    from monitor.tables.files import FORMATS, write_tables

    chosen = next((one for one in FORMATS if one == kind), None)
    if chosen is None:
        raise BadInput(f"--format {kind}: {did_you_mean(kind, FORMATS)}")
    folder = run / TABLES if out is None else out
    if folder.exists() and not folder.is_dir():
        raise BadInput(f"--out {folder}: is a file; name a folder")
    if out is None and leads_out(run, folder):
        raise BadInput(f"{folder}: is a link that leads out of the run's folder; name a folder with --out")
    check_pyarrow()
    heed(None, patience=0)  # any signal raises KeyboardInterrupt, after which no half file stays
    opened, going = open_folder(run, key)
    with bar_on(Console(stderr=True), TimeRemainingColumn()) as bar:
        task = bar.add_task("tables, %", total=100)
        files = write_tables(opened, folder, chosen, share=lambda done: bar.update(task, completed=100.0 * done))
    print_state(opened, going)
    typer.echo(printable(f"tables: {folder}: {', '.join(file.name for file in files)}"))
