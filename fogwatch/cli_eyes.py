"""``fogwatch record``, ``recording``, ``report`` and ``compare``: a run looked at afterwards.

Commands raise BadInput; the caller prints it.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from patrol.errors import BadInput
from patrol.warmup import warm

if TYPE_CHECKING:
    from monitor.analysis import Analysis
    from monitor.runs import Run

RUN = typer.Argument(metavar="RUN", help="A run's folder.")
PANEL = "Runs afterwards"
STILL_S = 30.0
"""A journal without an end that was written to within so many seconds of wall time may still be growing."""

BROKEN = 1


def record(
    run: Annotated[Path, RUN],
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="Default: recording.mcap in the folder.")] = None,
) -> None:
    """Write a run's recording: an MCAP file of ROS 2 messages that Foxglove, Lichtblick, Rerun or PlotJuggler open."""
    what, going = _open(run)
    from monitor.recording import FILE, Recorder, key_frame_ticks
    from monitor.replay import play

    file = run / FILE if out is None else out
    recorder = Recorder(what, file)
    try:
        wrong = play(what, [recorder])
        recorder.close()
    except BaseException:
        recorder.abandon()
        raise
    _say_state(what, going)
    if wrong is not None:
        typer.echo(f"the fog is not the run's own from {wrong * what.step:g} s on: scenario or map differ", err=True)
    every = key_frame_ticks(what) * what.step
    megabytes = file.stat().st_size / 1e6
    typer.echo(f"recording: {file}, {megabytes:.1f} MB, {what.ticks * what.step:g} s, a grid every {every:g} s")


def recording(
    file: Annotated[Path, typer.Argument(metavar="FILE.mcap", help="A recording.")],
    repair: Annotated[
        Path | None, typer.Option(metavar="NEW.mcap", help="Write a whole copy of what can be read.")
    ] = None,
) -> int:
    """Say what a recording holds and whether it is whole. Exit code 1: it is cut off or damaged."""
    from monitor.mcapfile import look

    contents = look(file, repair)
    facts = contents.facts
    typer.echo(
        f"{facts.get('scenario', '?')}: {contents.begin_s:g} to {contents.end_s:g} s, by {facts.get('software')}"
    )
    typer.echo(f"  in /fog 100 is {facts.get('fog_scale_s')} s; the run: {facts.get('ended')}")
    for topic, count in sorted(contents.messages.items()):
        typer.echo(f"  {count:8} {topic}")
    if not contents.why_cut:
        typer.echo("whole, checksums right")
        return 0
    saved = f"; saved as {repair}" if repair else "; --repair NEW.mcap saves what there is"
    typer.echo(f"cut off: {contents.why_cut}{saved}")
    return 0 if repair else BROKEN


def report(
    run: Annotated[Path, RUN],
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="Default: report.html in the folder.")] = None,
    figures: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write each figure as PNG and SVG into this folder.")
    ] = None,
) -> None:
    """Write a run's report: what happened, as one HTML file that needs no network."""
    what, going = _open(run)
    from monitor.analysis import analyse
    from monitor.report import FILE, write_report

    file = run / FILE if out is None else out
    made = write_report(analyse(what), file, going, figures)
    _say_state(what, going)
    typer.echo(f"report: {file}")
    if figures is not None:
        typer.echo(f"figures: {figures}: {', '.join(drawing.name for drawing in made)}")


def compare(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN RUN...", help="Folders of runs.")],
    out: Annotated[Path, typer.Option(metavar="FILE", help="The page to write.")] = Path("compare.html"),
    figures: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write each figure as PNG and SVG into this folder.")
    ] = None,
) -> None:
    """Put runs side by side: their measures in a table here, and with their fogs in one HTML file."""
    if len(runs) < 2:
        raise BadInput(f"compare {runs[0]}: one run cannot be compared; name two or more (or use fogwatch report)")
    from rich.console import Console
    from rich.table import Table

    analyses = [_analysed(folder) for folder in runs]
    from monitor.compare import compare_html, drawings, names_of, rows_of
    from monitor.report import write_page

    made = drawings(analyses)
    write_page(compare_html(analyses, made), out)
    for drawing in made if figures is not None else ():
        drawing.save(figures or out.parent)
    opened = [analysis.run for analysis in analyses]
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="bold")
    table.add_column("")
    for name in names_of(opened):
        table.add_column(name, justify="right", overflow="fold")
    for row in rows_of(opened):
        table.add_row(*row)
    Console().print(table)
    typer.echo(f"comparison: {out}")


def _analysed(folder: Path) -> Analysis:
    what, going = _open(folder)
    from monitor.analysis import analyse

    _say_state(what, going)
    return analyse(what)


def _open(folder: Path) -> tuple[Run, bool]:
    """The run in a folder, and whether it may still be going."""
    warm(("patrol", "monitor"), lambda line: typer.echo(line, err=True))
    from monitor.runs import open_run

    run = open_run(folder)
    age_s = time.time() - run.journal.path.stat().st_mtime
    return run, run.ended is None and age_s < STILL_S


def _say_state(run: Run, going: bool) -> None:
    """Say what is missing of a run, on the standard error."""
    from monitor.analysis import state_of

    if why := state_of(run, going)[1]:
        typer.echo(f"{run.folder}: {why}", err=True)
