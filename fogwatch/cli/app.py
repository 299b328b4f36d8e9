"""The command `fogwatch`. Commands import the heavy libraries that they need, so that help and errors are quick."""

from __future__ import annotations

import os
import platform
import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any

import typer

from fogwatch.cli import (
    chaos_command,
    experiment,
    finished,
    key,
    map_commands,
    paper,
    scenario,
    sweep,
)
from fogwatch.cli import control as controls
from fogwatch.cli import page as pages
from patrol.errors import BadInput
from patrol.process.lifeline import heed
from patrol.scenario import BUILTINS, MAX_ROBOTS, RobotGroup, open_scenario, parse_overrides, with_spares

INTERRUPTED = 130
UNKNOWN = 3

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Patrol with no centre: robots that share only their positions and are drawn to what nobody has seen for "
    "longest.",
    epilog="Try: fogwatch run yards --robots 5 --duration 600",
)
app.add_typer(scenario.app, name="scenario")
app.add_typer(map_commands.app, name="map")
app.add_typer(key.app, name="key")
app.command(epilog=controls.EPILOG)(controls.control)
app.command()(sweep.sweep)
app.command()(chaos_command.chaos)
for command in (finished.report, finished.compare, finished.record, finished.recording):
    app.command(rich_help_panel=finished.PANEL)(command)
app.command(rich_help_panel=finished.PANEL)(pages.replay)
app.command()(pages.monitor)
app.add_typer(paper.app, name="paper")
app.add_typer(experiment.app, name="experiment")

EXIT_CODES = "Exit codes: 0 verdict valid, 1 invalid, 2 bad input, 3 unknown (it could not be judged), 130 interrupted."
PAGE_SPARES = 2
"""How many robots a page can add unless the scenario or the command line says so."""
BODY = "Robots"
RUN = "Run"


@app.command(epilog=EXIT_CODES)
def run(
    what: Annotated[
        str,
        typer.Argument(
            metavar="SCENARIO",
            help=f"A scenario file, a map_server map, or a built-in terrain: {', '.join(BUILTINS)}.",
        ),
    ],
    robots: Annotated[int | None, typer.Option(metavar="N", help="How many robots.", rich_help_panel=BODY)] = None,
    spare: Annotated[
        int | None,
        typer.Option(metavar="N", help="How many more may join; 2 where there is a page.", rich_help_panel=BODY),
    ] = None,
    model: Annotated[str | None, typer.Option(metavar="car|holonomic", help="Kind.", rich_help_panel=BODY)] = None,
    radius: Annotated[float | None, typer.Option(metavar="M", help="Body radius, m.", rich_help_panel=BODY)] = None,
    speed: Annotated[float | None, typer.Option(metavar="M/S", help="Top speed, m/s.", rich_help_panel=BODY)] = None,
    start: Annotated[
        list[str] | None,
        typer.Option(metavar="X,Y", help="Start of the next robot, m. Repeatable.", rich_help_panel=BODY),
    ] = None,
    duration: Annotated[float | None, typer.Option(metavar="S", help="Simulated time, s.", rich_help_panel=RUN)] = None,
    seed: Annotated[int | None, typer.Option(metavar="K", help="Of all randomness.", rich_help_panel=RUN)] = None,
    pace: Annotated[
        str | None,
        typer.Option(metavar="lockstep|realtime|X", help="As fast as it goes, or X times real.", rich_help_panel=RUN),
    ] = None,
    point: Annotated[float | None, typer.Option(metavar="M", help="Side of a point, m.", rich_help_panel=RUN)] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="FIELD=VALUE", help="Override any field. Repeatable.", rich_help_panel=RUN),
    ] = None,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Run folder, new or empty.")] = None,
    in_process: Annotated[bool, typer.Option("--in-process", help="One process, without Zenoh: same trace.")] = False,
    port: Annotated[int | None, typer.Option(metavar="N", help="TCP port of the router (default: a free one).")] = None,
    page: Annotated[bool, typer.Option("--page/--no-page", help="Serve a live page of the processes.")] = True,
    recording: Annotated[bool, typer.Option("--recording/--no-recording", help="Write recording.mcap.")] = True,
    report: Annotated[bool, typer.Option("--report/--no-report", help="Write report.html.")] = True,
    recovery: Annotated[
        bool, typer.Option("--recovery", help="Run it without its faults too, to judge recovery by.")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print the run folder and nothing else.")] = False,
) -> int:
    """Run a fleet, each robot a process of its own, and judge the run.

    A scenario file says everything; the options override its fields. Without a file: five cars for 5000 s.
    """
    overrides: dict[str, object] = {
        "robots.count": robots,
        "robots.model": model,
        "robots.radius": radius,
        "robots.speed": speed,
        "robots.starts": [_place(text) for text in start] if start else None,
        "duration": duration,
        "seed": seed,
        "pace": pace,
        "point": point,
    }
    given = {field: value for field, value in overrides.items() if value is not None}
    if port is not None and not 0 < port < 65536:
        raise BadInput(f"--port {port}: no TCP port; give one from 1 to 65535")
    ending = heed(None, patience=0)
    scenario = open_scenario(what, {**given, **parse_overrides(settings or [])})
    served = page and not quiet and not in_process
    if spare is not None:
        scenario = with_spares(scenario, spare)
    elif served and isinstance(scenario.robots, RobotGroup) and scenario.robots.spare is None:
        scenario = with_spares(scenario, min(PAGE_SPARES, MAX_ROBOTS - scenario.robots.count))

    from rich.console import Console

    from fogwatch.api import RunOptions, execute
    from fogwatch.launch.launcher import Failed
    from fogwatch.launch.live_table import make_display
    from fogwatch.launch.summary_text import print_report

    def begin() -> None:
        ending.patience = 1  # the first ends the run in order, the second at once

    display = make_display(quiet)
    run_options = RunOptions(
        out,
        in_process,
        port,
        display,
        begin=begin,
        stop=lambda: bool(ending),
        urgent=lambda: ending.times > 1,
        recording=recording,
        report=report,
        page=served,
        recovery=recovery,
    )
    try:
        result = execute(scenario, run_options)
    except Failed as failed:
        _complain(str(failed))
        return UNKNOWN
    with _readers_may_leave():
        if quiet:
            print(result.folder)
        else:
            print_report(Console(), result.summary, result.folder)
    return INTERRUPTED if ending else result.verdict.exit_code


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"fogwatch {metadata.version('fogwatch')}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_print_version, help="Print the version.")
    ] = False,
) -> None:
    """What goes before a command."""


@app.command()
def version() -> None:
    """Print the versions of fogwatch and of what it stands on."""
    print(f"fogwatch {metadata.version('fogwatch')}")
    print(f"Python {platform.python_version()} on {platform.platform()}")
    for name in ("eclipse-zenoh", "numpy", "numba", "pydantic", "msgpack", "Pillow", "matplotlib", "scipy"):
        try:
            print(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            print(f"{name} not installed")


def main() -> int:
    """The command's entry point; the exit code."""
    code = guarded(lambda: app(standalone_mode=False))
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except BrokenPipeError:  # or the interpreter finds it while it ends, and makes 120 of any exit code
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    return code


def guarded(command: Callable[[], Any]) -> int:
    """Run a command; what the user can mend is one line on the standard error."""
    try:
        code = command()
    except BadInput as bad:
        _complain(str(bad))
        return 2
    except (KeyboardInterrupt, typer.Abort):
        code = INTERRUPTED
    except BrokenPipeError:
        return 0
    except Exception as error:  # noqa: BLE001 - a mistake of ours leaves the run unjudged, not invalid
        if not hasattr(error, "format_message"):
            traceback.print_exc()
            return UNKNOWN
        if message := error.format_message():  # without one it has printed the help
            _complain(message)
        return 2
    if code == INTERRUPTED:  # typer may have made that of the signal
        _complain("interrupted")
    return code if isinstance(code, int) else 0


def _complain(line: str) -> None:
    """Say it on the standard error, if anybody listens."""
    with suppress(BrokenPipeError):
        print(f"fogwatch: {line}", file=sys.stderr, flush=True)


@contextmanager
def _readers_may_leave() -> Iterator[None]:
    """Print what nobody may read to its end; the exit code is the same."""
    try:
        yield
        sys.stdout.flush()
    except (BrokenPipeError, SystemExit):  # rich turns the first into the second
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _place(text: str) -> list[float]:
    """A start: X,Y or X,Y,HEADING."""
    try:
        place = [float(part) for part in text.split(",")]
    except ValueError:
        place = []
    if len(place) not in (2, 3):
        raise BadInput(f"--start {text}: expected X,Y or X,Y,HEADING in m and rad, for example --start 12.5,40")
    return place
