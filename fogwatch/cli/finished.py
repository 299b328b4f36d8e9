"""``fogwatch record``, ``recording``, ``report`` and ``compare``: a run looked at afterwards.

Commands raise BadInput; the caller prints it.
"""

from __future__ import annotations

import time
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from patrol.errors import BadInput
from patrol.process.lifeline import heed
from patrol.process.warmup import warm

if TYPE_CHECKING:
    from monitor.replay.run import Run
    from monitor.report.analysis import Analysis

RUN = typer.Argument(metavar="RUN", help="A run's folder.")
PANEL = "Runs afterwards"
STILL_S = 30.0
"""A journal without an end that was written to within so many seconds of wall time may still be growing, even where no
world answers: one in a process of its own has none."""

BROKEN = 1
INTERRUPTED = 130


def record(
    run: Annotated[Path | None, typer.Argument(metavar="[RUN]", help="A run's folder.")] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Default: recording.mcap in the folder; of a fleet, FLEET.mcap.")
    ] = None,
    router: Annotated[str | None, typer.Option(metavar="LOCATOR", help="Or a running fleet: its router,")] = None,
    fleet: Annotated[str | None, typer.Option(metavar="NAME", help="and its name.")] = None,
    scenario: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Of robots without a world: positions alone are heard.")
    ] = None,
    radio: Annotated[str | None, typer.Option(metavar="LOCATOR", help="Where such robots hear each other.")] = None,
    wait: Annotated[float, typer.Option(metavar="S", help="How long to wait for the fleet.")] = 60.0,
) -> int:
    """Write a recording: an MCAP file of ROS 2 messages that Foxglove, Lichtblick, Rerun or PlotJuggler open.

    Of a run's folder, all that there is of the run; of a fleet that is running, what happens from now on, until the run
    ends, its world is gone, or Ctrl-C is pressed.
    """
    fleets = (router is not None) + (fleet is not None)
    if fleets != (2 if run is None else 0):
        raise BadInput("record: name a run's folder, or --router and --fleet of a running fleet")
    if run is not None:
        if scenario is not None or radio is not None:
            raise BadInput("record: --scenario and --radio are for robots without a world; leave the folder out")
        _record_run(run, out)
    elif router is not None and fleet is not None:
        return _record_fleet(out or Path(f"{fleet}.mcap"), router, fleet, scenario, radio, wait)
    return 0


def _record_fleet(out: Path, router: str, fleet: str, scenario: Path | None, radio: str | None, wait_s: float) -> int:
    """Record a fleet until its run ends or somebody interrupts, which is how it ends well; the exit code."""
    from monitor.replay.run_files import check_out

    check_out(out, f"{fleet}.mcap")
    ending = heed(None, patience=1)
    if out.exists():
        raise BadInput(f"{out}: is there already; name a new file with --out")
    warm(("patrol", "monitor"), lambda line: typer.echo(line, err=True))
    from monitor.live.attach import open_fleet
    from monitor.recording.live_recorder import record_live

    source = open_fleet(ending, router=router, fleet=fleet, scenario=scenario, radio=radio, wait_s=wait_s)
    if source is None:
        return INTERRUPTED

    def say(line: str) -> None:
        typer.echo(f"record: {line}", err=True)

    started = datetime.now(UTC).isoformat(timespec="seconds")
    try:
        say(f"{fleet} into {out}; Ctrl-C ends it")
        last = record_live(source, out, started, lambda: bool(ending), say)
    finally:
        source.close()
    what = "nothing was heard"
    if last is not None:
        what = f"up to {last.time_s:g} s, {last.ended or ('its world is gone' if last.gone else 'it goes on')}"
    typer.echo(f"recording: {out}, {out.stat().st_size / 1e6:.1f} MB, {what}")
    return 0


def _record_run(run: Path, out: Path | None) -> None:
    from monitor.replay.run_files import RECORDING, check_out

    file = run / RECORDING if out is None else out
    if out is not None:
        check_out(out, RECORDING)
    what, going = _open(run)
    from monitor.recording.run_recorder import Recorder, key_frame_ticks
    from monitor.replay.replay import play

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
    from monitor.recording.mcap_file import inspect_recording

    contents = inspect_recording(file, repair)
    facts = contents.facts
    by = facts.get("software") or facts.get("told_by")
    typer.echo(f"{facts.get('scenario', '?')}: {contents.begin_s:g} to {contents.end_s:g} s, by {by}")
    scale = facts.get("fog_scale_s", "?")
    typer.echo(f"  in /fog 100 is {scale}{' s' if scale[:1].isdigit() else ''}; the run: {facts.get('ended')}")
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
    from monitor.replay.run_files import REPORT, check_out

    file = run / REPORT if out is None else out
    if out is not None:
        check_out(out, REPORT)
    what, going = _open(run)
    from monitor.report.analysis import analyse
    from monitor.report.document import write_report

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

    from monitor.replay.run_files import check_out

    check_out(out, "compare.html")

    analyses = [_analysed(folder) for folder in runs]
    from monitor.report.compare import compare_html, drawings, names_of, rows_of
    from monitor.report.document import write_page

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
    from monitor.report.analysis import analyse

    _say_state(what, going)
    return analyse(what)


def _open(folder: Path) -> tuple[Run, bool]:
    """The run in a folder, and whether it may still be going."""
    from monitor.replay.run_files import journal_in

    journal_in(folder)
    warm(("patrol", "monitor"), lambda line: typer.echo(line, err=True))
    from monitor.replay.run import open_run

    run = open_run(folder)
    return run, run.ended is None and _may_go_on(run)


def _may_go_on(run: Run) -> bool:
    """Whether a run without an end may be going: its journal grew lately, or its world is there, paused perhaps."""
    if time.time() - run.journal.path.stat().st_mtime < STILL_S:
        return True
    from patrol.net.access import FILE

    if not (run.folder / FILE).is_file():
        return False
    from monitor.live.attach import is_running

    return is_running(run.folder)


def _say_state(run: Run, going: bool) -> None:
    """Say what is missing of a run, on the standard error."""
    from monitor.report.analysis import state_of

    if why := state_of(run, going)[1]:
        typer.echo(f"{run.folder}: {why}", err=True)
