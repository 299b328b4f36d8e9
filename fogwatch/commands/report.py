"""``fogwatch report`` and ``compare``: runs as HTML pages. Commands raise BadInput; the caller prints it."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from fogwatch.cli.command_help import command
from fogwatch.cli.ending import note, say
from fogwatch.cli.open_run import Key, RunFolder, open_folder, print_state
from fogwatch.cli.options import argument, option
from patrol.errors import BadInput, printable

if TYPE_CHECKING:
    from monitor.report.analysis import Analysis

PROGRESS_S = 5.0
"""Time between two lines that say how far a comparison is, s."""

Figures = Annotated[Path | None, option("DIR", "Write each figure as PNG, SVG and PDF into this folder as well.")]


@command(examples=["fogwatch report runs/yards-20260101-120000 --figures figures", "fogwatch report RUN --csv tables"])
def report(
    run: RunFolder,
    out: Annotated[Path | None, option("FILE", "File to write (default: report.html in the run's folder).")] = None,
    figures: Figures = None,
    csv: Annotated[
        Path | None,
        option("DIR", "Write the visits of terrain.graph's vertices as CSV files of patrolling_sim as well."),
    ] = None,
    key: Key = None,
) -> None:
    """Write a run's report: one HTML file, readable without a network, that shows what happened."""
    from monitor.replay.run_files import REPORT, check_out

    file = run / REPORT if out is None else out
    if out is not None:
        check_out(out, REPORT)
    opened, going = open_folder(run, key)
    from monitor.report.analysis import analyse
    from monitor.report.document import write_report
    from monitor.report.patrolling_csv import write_csv

    tables = write_csv(opened, csv) if csv is not None else []
    drawn = write_report(analyse(opened), file, going, figures)
    print_state(opened, going)
    say(f"report: {file}")
    if figures is not None:
        say(f"figures: {figures}: {', '.join(drawing.name for drawing in drawn)}")
    if csv is not None:
        say(f"tables: {csv}: {', '.join(table.name for table in tables)}")


@command(examples=["fogwatch compare runs/yards-1 runs/yards-2 --out compare.html"])
def compare(
    runs: Annotated[list[Path], argument("RUN RUN...", "Folders of two or more runs.")],
    out: Annotated[Path, option("FILE", "File to write.")] = Path("compare.html"),
    figures: Figures = None,
) -> None:
    """Compare runs: print their measures and the settings that differ, and write an HTML file with their fogs too."""
    if len(runs) < 2:
        raise BadInput(f"compare {runs[0]}: one run cannot be compared; name two or more (or use fogwatch report)")
    from rich.console import Console

    from fogwatch.cli.columns import print_side_by_side
    from monitor.replay.run_files import check_out

    check_out(out, "compare.html")

    analyses, due_s = [], time.monotonic() + PROGRESS_S
    for count, folder in enumerate(runs):
        if time.monotonic() >= due_s:
            due_s = time.monotonic() + PROGRESS_S
            note(f"comparing: {count} of {len(runs)} runs are read")
        analyses.append(_analyse_folder(folder))
    from monitor.report.compare import cautions, compare_html, contradictions, differences, drawings, names_of, rows_of
    from monitor.report.document import write_page

    drawn = drawings(analyses)
    write_page(compare_html(analyses, drawn), out)
    for drawing in drawn if figures is not None else ():
        drawing.save(figures or out.parent)
    opened = [analysis.run for analysis in analyses]
    differ = [tuple(map(printable, row)) for row in differences(opened)]
    shown = contradictions(differ)
    print_side_by_side(Console(), names_of(opened), [("", rows_of(opened)), ("settings that differ", shown)])
    if not differ:
        say("settings: all runs have the same scenario")
    if len(shown) < len(differ):
        say(f"{len(differ) - len(shown)} more options, which only some of the policies have: {printable(str(out))}")
    for line in cautions(differ):
        say(line)
    say(f"comparison: {out}")


def _analyse_folder(folder: Path) -> Analysis:
    opened, going = open_folder(folder)
    from monitor.report.analysis import analyse

    print_state(opened, going)
    return analyse(opened)
