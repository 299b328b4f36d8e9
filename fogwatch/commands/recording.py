"""``fogwatch record`` and ``export``: MCAP files and tables of runs. Commands raise BadInput; the caller prints it."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

from fogwatch.cli.command_help import command
from fogwatch.cli.ending import note, say
from fogwatch.cli.open_run import Key, RunFolder, open_folder, print_state
from fogwatch.cli.options import argument, option
from fogwatch.commands.fleet import WAIT_S, FleetOptions, Wait
from patrol.errors import BadInput, did_you_mean
from patrol.files.untrusted import leads_out
from runtime.process.failures import INTERRUPTED
from runtime.process.lifeline import heed
from runtime.starting.warmup import warm

TABLES = "tables"


@command(
    examples=[
        "fogwatch export runs/yards-20260101-120000 --format parquet",
        "fogwatch export RUN --format csv --out tables",
    ],
    exit_codes="0 done, 2 bad input, 130 interrupted",
)
def export(
    run: RunFolder,
    kind: Annotated[str, option("parquet|csv", "Format of the files.", "--format")] = "parquet",
    out: Annotated[Path | None, option("DIR", "Folder of the files (default: tables in the run's folder).")] = None,
    key: Key = None,
) -> None:
    """Write a run's tables for pandas, polars or a spreadsheet, a file a table.

    The tables are ticks, robots, links, events, visits (of a graph's vertices) and ground. Files of these names in the
    folder are replaced, all of them or none.
    """
    from fogwatch.terminal.live_table import bar_on
    from monitor.tables.arrow import FORMATS, write_tables
    from monitor.tables.table import check_pyarrow

    chosen = next((candidate for candidate in FORMATS if candidate == kind), None)
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
    with bar_on() as bar:
        task = bar.add_task("tables, %", total=100)
        files = write_tables(opened, folder, chosen, share=lambda done: bar.update(task, completed=100.0 * done))
    print_state(opened, going)
    say(f"tables: {folder}: {', '.join(file.name for file in files)}")


@command(
    examples=[
        "fogwatch record runs/yards-20260101-120000 --out yards.mcap",
        "fogwatch record --credentials yards-1/viewer",
        "fogwatch record --router tcp/192.168.1.10:7447 --fleet yards-1",
    ],
    exit_codes="0 the recording is complete, 2 bad input, 130 interrupted before a fleet answered",
)
def record(
    run: Annotated[Path | None, argument("[RUN]", "Folder of a run.")] = None,
    out: Annotated[
        Path | None, option("FILE", "File to write (default: recording.mcap in the run's folder, or FLEET.mcap).")
    ] = None,
    *,
    fleet: FleetOptions,
    wait: Wait = WAIT_S,
) -> int:
    """Write a recording: an MCAP file of ROS 2 messages for Foxglove, Lichtblick, Rerun or PlotJuggler.

    Given the folder of a run, it holds the whole run so far. Given a running fleet (--credentials, or --router and
    --fleet), it holds what happens from now on, until the run ends, its world is gone, or Ctrl-C is pressed. The tool
    `mcap` inspects recordings, and makes one whole that was cut off: mcap recover FILE --output NEW.
    """
    fleet.check_one_fleet("record", run)
    if run is not None:
        if fleet.scenario is not None or fleet.radio is not None:
            raise BadInput("record: --scenario and --radio are for robots without a world; leave the folder out")
        _record_run(run, out)
        return 0
    from runtime.process.options import meeting
    from runtime.security.roles import Kind

    name = meeting(fleet.credentials, fleet.router, fleet.fleet, Kind.VIEWER, Kind.OPERATOR).keys.fleet
    return _record_fleet(out or Path(f"{name}.mcap"), name, fleet, wait)


def _record_fleet(out: Path, name: str, fleet: FleetOptions, wait_s: float) -> int:
    """Record a fleet until its run ends or Ctrl-C is pressed, which is no failure; the exit code."""
    from monitor.replay.run_files import check_out

    check_out(out, f"{name}.mcap")
    ending = heed(None, patience=1)
    if out.exists():
        raise BadInput(f"{out}: exists already; name a new file with --out")
    warm(("patrol", "monitor"), note)
    from monitor.live.attach import open_fleet
    from monitor.recording.live_recorder import record_live

    source = open_fleet(ending, **vars(fleet), wait_s=wait_s)
    if source is None:
        return INTERRUPTED

    def tell(line: str) -> None:
        note(f"record: {line}")

    started = datetime.now(UTC).isoformat(timespec="seconds")
    try:
        tell(f"recording fleet {name} into {out}; press Ctrl-C to end")
        last = record_live(source, out, started, lambda: bool(ending), tell)
    finally:
        source.close()
    content = "nothing was received"
    if last is not None:
        content = f"up to {last.time_s:g} s, {last.ended or ('its world is gone' if last.gone else 'the run goes on')}"
    say(f"recording: {out}, {out.stat().st_size / 1e6:.1f} MB, {content}")
    return 0


def _record_run(run: Path, out: Path | None) -> None:
    from monitor.replay.run_files import RECORDING, check_out

    file = run / RECORDING if out is None else out
    if out is not None:
        check_out(out, RECORDING)
    opened, going = open_folder(run)
    from fogwatch.run_folder.derived import recorded
    from monitor.recording.run_recorder import key_frame_ticks
    from monitor.replay.replay import play

    with recorded(opened, file) as recorder:
        wrong = play(opened, [recorder])
    print_state(opened, going)
    if wrong is not None:
        since = wrong * opened.step
        note(f"from {since:g} s on the replayed fog differs from the run's: scenario or map differ")
    every = key_frame_ticks(opened) * opened.step
    megabytes = file.stat().st_size / 1e6
    say(f"recording: {file}, {megabytes:.1f} MB, {opened.ticks * opened.step:g} s, a whole grid every {every:g} s")
