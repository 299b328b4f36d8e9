"""``fogwatch record`` and ``recording``: MCAP files of runs. Commands raise BadInput; the caller prints it."""

from __future__ import annotations

from argparse import Namespace
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

from fogwatch.cli.fleets.fleet_options import (
    WAIT_S,
    CredentialsOption,
    Fleet,
    FleetScenario,
    Radio,
    Router,
    Wait,
    check_one_fleet,
)
from fogwatch.cli.runs.open_run import open_folder, print_state
from patrol.errors import BadInput
from patrol.printable import printable
from patrol.process.exit_codes import INTERRUPTED
from patrol.process.lifeline import heed
from patrol.process.starting.warmup import warm

RECORD_EXAMPLES = [
    "fogwatch record runs/yards-20260101-120000 --out yards.mcap",
    "fogwatch record --credentials yards-1/viewer",
    "fogwatch record --router tcp/192.168.1.10:7447 --fleet yards-1",
]
RECORDING_EXAMPLES = ["fogwatch recording yards.mcap --repair repaired.mcap"]

BROKEN = 1


def record(
    run: Annotated[Path | None, typer.Argument(metavar="[RUN]", help="Folder of a run.")] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="File to write (default: recording.mcap in the run's folder, or FLEET.mcap)."
        ),
    ] = None,
    credentials: CredentialsOption = None,
    router: Router = None,
    fleet: Fleet = None,
    scenario: FleetScenario = None,
    radio: Radio = None,
    wait: Wait = WAIT_S,
) -> int:
    """Write a recording: an MCAP file of ROS 2 messages for Foxglove, Lichtblick, Rerun or PlotJuggler.

    Given the folder of a run, it holds the whole run so far. Given a running fleet (--credentials, or --router and
    --fleet), it holds what happens from now on, until the run ends, its world is gone, or Ctrl-C is pressed.
    """
    check_one_fleet("record", run, credentials, router, fleet)
    if run is not None:
        if scenario is not None or radio is not None:
            raise BadInput("record: --scenario and --radio are for robots without a world; leave the folder out")
        _record_run(run, out)
        return 0
    from patrol.net.security.roles import Kind
    from patrol.process.options import meeting

    named = Namespace(credentials=credentials, router=router, fleet=fleet)
    name = meeting(credentials, router, fleet, Kind.VIEWER, Kind.OPERATOR).keys.fleet
    return _record_fleet(out or Path(f"{name}.mcap"), name, named, scenario, radio, wait)


def _record_fleet(
    out: Path, fleet: str, named: Namespace, scenario: Path | None, radio: str | None, wait_s: float
) -> int:
    """Record a fleet until its run ends or Ctrl-C is pressed, which is no failure; the exit code."""
    from monitor.replay.run_files import check_out

    check_out(out, f"{fleet}.mcap")
    ending = heed(None, patience=1)
    if out.exists():
        raise BadInput(f"{out}: exists already; name a new file with --out")
    warm(("patrol", "monitor"), lambda line: typer.echo(line, err=True))
    from monitor.live.attach import open_fleet
    from monitor.recording.live_recorder import record_live

    source = open_fleet(ending, **vars(named), scenario=scenario, radio=radio, wait_s=wait_s)
    if source is None:
        return INTERRUPTED

    def say(line: str) -> None:
        typer.echo(f"record: {line}", err=True)

    started = datetime.now(UTC).isoformat(timespec="seconds")
    try:
        say(f"recording fleet {fleet} into {out}; press Ctrl-C to end")
        last = record_live(source, out, started, lambda: bool(ending), say)
    finally:
        source.close()
    content = "nothing was received"
    if last is not None:
        content = f"up to {last.time_s:g} s, {last.ended or ('its world is gone' if last.gone else 'the run goes on')}"
    typer.echo(printable(f"recording: {out}, {out.stat().st_size / 1e6:.1f} MB, {content}"))
    return 0


def _record_run(run: Path, out: Path | None) -> None:
    from monitor.replay.run_files import RECORDING, check_out

    file = run / RECORDING if out is None else out
    if out is not None:
        check_out(out, RECORDING)
    opened, going = open_folder(run)
    from monitor.recording.run_recorder import Recorder, key_frame_ticks
    from monitor.replay.replay import play

    recorder = Recorder(opened, file)
    try:
        wrong = play(opened, [recorder])
        recorder.close()
    except BaseException:
        recorder.abandon()
        raise
    print_state(opened, going)
    if wrong is not None:
        since = wrong * opened.step
        typer.echo(f"from {since:g} s on the replayed fog differs from the run's: scenario or map differ", err=True)
    every = key_frame_ticks(opened) * opened.step
    megabytes = file.stat().st_size / 1e6
    typer.echo(
        f"recording: {file}, {megabytes:.1f} MB, {opened.ticks * opened.step:g} s, a whole grid every {every:g} s"
    )


def recording(
    file: Annotated[Path, typer.Argument(metavar="FILE.mcap", help="Recording to look at.")],
    repair: Annotated[
        Path | None, typer.Option(metavar="NEW.mcap", help="Write a complete file with all that can be read.")
    ] = None,
) -> int:
    """Print what a recording holds and whether it is complete, and repair a damaged one."""
    from monitor.recording.mcap_file import inspect_recording

    contents = inspect_recording(file, repair)
    facts = contents.facts
    by = facts.get("software") or facts.get("told_by")

    def say(line: str) -> None:
        typer.echo(printable(line))

    say(f"{facts.get('scenario', '?')}: {contents.begin_s:g} to {contents.end_s:g} s, by {by}")
    scale = facts.get("fog_scale_s", "?")
    unit = " s" if scale[:1].isdigit() else ""
    say(f"  in /fog, 100 stands for {scale}{unit}; the run: {facts.get('ended')}")
    for topic, count in sorted(contents.messages.items()):
        say(f"  {count:8} {topic}")
    if not contents.why_cut:
        typer.echo("complete, checksums right")
        return 0
    saved = f"; repaired copy: {repair}" if repair else "; --repair NEW.mcap saves what can be read"
    typer.echo(f"cut off: {contents.why_cut}{saved}")
    return 0 if repair else BROKEN
