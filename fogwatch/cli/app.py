"""The command `fogwatch`. Commands import the heavy libraries that they need, so that help and errors are quick."""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from importlib import metadata
from pathlib import Path
from typing import Annotated

import typer

from fogwatch.cli.command_help import FINISHED, OTHER, RUNNING, START, OrderedGroup, command
from fogwatch.cli.ending import complain, run_app
from fogwatch.cli.patrol_option import patrol_option
from fogwatch.cli.studies import add_studies
from fogwatch.commands import animate as animate_command
from fogwatch.commands import control, fleet, key, page, scenario
from fogwatch.commands import doctor as doctor_command
from fogwatch.commands import judge as judge_command
from fogwatch.commands import map as map_commands
from fogwatch.commands import processes as process_commands
from fogwatch.commands import recording as export_command
from fogwatch.commands import recording as recording_commands
from fogwatch.commands import report as report_commands
from fogwatch.commands import status as status_command
from fogwatch.presets import PRESETS, preset_settings
from patrol.errors import BadInput
from patrol.pose import MODELS
from patrol.printable import printable
from patrol.process.exit_codes import INTERRUPTED, UNKNOWN
from patrol.process.lifeline import ending_children, heed
from patrol.scenario import BUILTINS, MAX_ROBOTS, RobotGroup, naming, open_scenario, parse_overrides, with_spares
from patrol.scenario.patrols import patrol_settings

app = typer.Typer(
    cls=OrderedGroup,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Decentralised patrolling: robots that exchange nothing but their positions, and go where nobody has looked "
    "for longest.",
    epilog="Example:\n  fogwatch run yards --robots 5 --duration 600\n\n"
    "Each command has its own help, with an example: fogwatch run --help",
)
for group, name, panel in (
    (map_commands.app, "map", START),
    (scenario.app, "scenario", START),
    (key.app, "key", START),
    (fleet.app, "fleet", START),
):
    app.add_typer(group, name=name, rich_help_panel=panel)
process_commands.register(app, START)
command(app, examples=page.MONITOR_EXAMPLES, exit_codes=page.EXIT_CODES, panel=RUNNING)(page.monitor)
command(app, examples=doctor_command.EXAMPLES, exit_codes=doctor_command.EXIT_CODES, panel=START)(doctor_command.doctor)
command(app, examples=status_command.EXAMPLES, exit_codes=status_command.EXIT_CODES, panel=RUNNING)(
    status_command.status
)
command(app, examples=control.EXAMPLES, exit_codes=control.EXIT_CODES, panel=RUNNING)(control.control)
command(
    app,
    examples=recording_commands.RECORD_EXAMPLES,
    exit_codes="0 the recording is complete, 2 bad input, 130 interrupted before a fleet answered",
    panel=RUNNING,
)(recording_commands.record)
command(app, examples=page.REPLAY_EXAMPLES, exit_codes=page.REPLAY_EXIT_CODES, panel=FINISHED)(page.replay)
command(app, examples=report_commands.REPORT_EXAMPLES, panel=FINISHED)(report_commands.report)
command(app, examples=animate_command.EXAMPLES, panel=FINISHED)(animate_command.animate)
command(app, examples=export_command.EXAMPLES, exit_codes=export_command.EXIT_CODES, panel=FINISHED)(
    export_command.export
)
command(app, examples=judge_command.EXAMPLES, exit_codes=judge_command.EXIT_CODES, panel=FINISHED)(judge_command.judge)
command(app, examples=report_commands.COMPARE_EXAMPLES, panel=FINISHED)(report_commands.compare)
command(
    app,
    examples=recording_commands.RECORDING_EXAMPLES,
    exit_codes="0 the recording is complete, or was repaired; 1 it is cut off or damaged; 2 bad input",
    panel=FINISHED,
)(recording_commands.recording)
add_studies(app, map_commands.app)

PAGE_SPARES = 2
"""Number of robots that may join a run with a live page, unless the scenario or an option sets another."""
MOST_THREADS = 64
BODY = "Robots"
RUN = "Run"
OUTPUT = "Output"


@command(
    app,
    examples=[
        "fogwatch run yards --robots 5 --duration 600",
        "fogwatch run my-map.yaml --model differential --radius 0.3 --speed 1",
        "fogwatch run examples/yards-five.yaml --set patrol.options.dilatation=2 --seed 7",
        "fogwatch run yards --patrol tour --robots 5",
        "fogwatch run yards --preset paper --robots 5 --model holonomic",
    ],
    exit_codes="0 verdict valid, 1 verdict invalid, 2 bad input, 3 verdict unknown (the run could not be judged), 130 "
    "interrupted",
    panel=START,
)
def run(
    what: Annotated[
        str,
        typer.Argument(
            metavar="SCENARIO",
            help=f"Scenario file, map file (map_server's YAML) or built-in terrain: {', '.join(BUILTINS)}.",
        ),
    ],
    robots: Annotated[int | None, typer.Option(metavar="N", help="Number of robots.", rich_help_panel=BODY)] = None,
    spare: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="Robots that may join during the run (default: 2 with a live page, else 0).",
            rich_help_panel=BODY,
        ),
    ] = None,
    model: Annotated[
        str | None, typer.Option(metavar="|".join(MODELS), help="Body model.", rich_help_panel=BODY)
    ] = None,
    radius: Annotated[float | None, typer.Option(metavar="M", help="Body radius in m.", rich_help_panel=BODY)] = None,
    speed: Annotated[float | None, typer.Option(metavar="M/S", help="Top speed in m/s.", rich_help_panel=BODY)] = None,
    turning_radius: Annotated[
        float | None, typer.Option(metavar="M", help="Tightest turn of a car, in m.", rich_help_panel=BODY)
    ] = None,
    sensor_range: Annotated[
        float | None, typer.Option(metavar="M", help="Range of the sensor in m.", rich_help_panel=BODY)
    ] = None,
    start: Annotated[
        list[str] | None,
        typer.Option(
            metavar="X,Y",
            help="Start of the next robot in m; X,Y,HEADING gives the heading too, in rad. Repeatable.",
            rich_help_panel=BODY,
        ),
    ] = None,
    duration: Annotated[
        float | None, typer.Option(metavar="S", help="Simulated time in s.", rich_help_panel=RUN)
    ] = None,
    seed: Annotated[int | None, typer.Option(metavar="K", help="Random seed.", rich_help_panel=RUN)] = None,
    pace: Annotated[
        str | None,
        typer.Option(
            metavar="lockstep|realtime|X",
            help="As fast as possible, in real time, or X times as fast as real time.",
            rich_help_panel=RUN,
        ),
    ] = None,
    point: Annotated[
        float | None, typer.Option(metavar="M", help="Side of one grid point in m.", rich_help_panel=RUN)
    ] = None,
    patrol: Annotated[str | None, patrol_option(RUN)] = None,
    preset: Annotated[
        str | None,
        typer.Option(
            metavar="|".join(PRESETS),
            help="; ".join(f"{name}: {meaning}" for name, meaning in PRESETS.items())
            + ". Other options and --set hold over it.",
            rich_help_panel=RUN,
        ),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="FIELD=VALUE",
            help="Set any field of the scenario, such as patrol.options.separation=none. Repeatable.",
            rich_help_panel=RUN,
        ),
    ] = None,
    in_process: Annotated[
        bool,
        typer.Option(
            "--in-process", help="Run in one process, without Zenoh; the trace is the same.", rich_help_panel=RUN
        ),
    ] = False,
    threads: Annotated[
        int,
        typer.Option(
            metavar="N",
            min=1,
            max=MOST_THREADS,
            help="Robots that decide at once with --in-process; more than 1 is seldom faster.",
            rich_help_panel=RUN,
        ),
    ] = 1,
    port: Annotated[
        int | None,
        typer.Option(metavar="N", help="TCP port of the router (default: a free one).", rich_help_panel=RUN),
    ] = None,
    recovery: Annotated[
        bool,
        typer.Option(
            "--recovery",
            help="Run the scenario without its faults as well, to judge the recovery.",
            rich_help_panel=RUN,
        ),
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Run folder, new or empty (default: runs/NAME-TIME).", rich_help_panel=OUTPUT),
    ] = None,
    page: Annotated[
        bool,
        typer.Option(
            "--page/--no-page",
            help="Serve a live page while the processes run (never with --in-process or --quiet).",
            rich_help_panel=OUTPUT,
        ),
    ] = True,
    picture: Annotated[
        bool,
        typer.Option("--picture/--no-picture", help="Draw fog.png at the end.", rich_help_panel=OUTPUT),
    ] = True,
    recording: Annotated[
        bool,
        typer.Option("--recording/--no-recording", help="Write recording.mcap at the end.", rich_help_panel=OUTPUT),
    ] = True,
    report: Annotated[
        bool,
        typer.Option("--report/--no-report", help="Write report.html at the end.", rich_help_panel=OUTPUT),
    ] = True,
    quiet: Annotated[
        bool, typer.Option("--quiet", help="Print nothing but the run folder.", rich_help_panel=OUTPUT)
    ] = False,
) -> int:
    """Run a fleet, one process per robot, and judge the run.

    Options override the settings of a scenario file. A map file or a built-in terrain has no settings: unless options
    say otherwise, five cars with a radius of 1 m patrol it for 5000 s.
    """
    overrides: dict[str, object] = {
        "robots.count": robots,
        "robots.model": model,
        "robots.radius": radius,
        "robots.speed": speed,
        "robots.turning_radius": turning_radius,
        "sensor.range": sensor_range,
        "robots.starts": [_place(text) for text in start] if start else None,
        "duration": duration,
        "seed": seed,
        "pace": pace,
        "point": point,
    }
    options_given = {field: value for field, value in overrides.items() if value is not None}
    if port is not None and not 0 < port < 65536:
        raise BadInput(f"--port {port}: is not a TCP port; give one from 1 to 65535")
    if threads > 1 and not in_process:
        raise BadInput(f"--threads {threads}: each robot is a process of its own; leave it out, or give --in-process")
    ending = heed(None, patience=0)
    overridden = {**preset_settings(preset), **options_given, **parse_overrides(settings or [])}
    overridden |= patrol_settings(patrol, overridden)
    scenario = open_scenario(what, overridden)
    served = page and not quiet and not in_process
    if spare is not None:
        scenario = with_spares(scenario, spare)
    elif served and isinstance(scenario.robots, RobotGroup) and scenario.robots.spare is None:
        scenario = with_spares(scenario, min(PAGE_SPARES, MAX_ROBOTS - scenario.robots.count))

    from rich.console import Console

    from fogwatch.api import RunOptions, execute
    from fogwatch.launch.launcher import LaunchFailed
    from fogwatch.terminal.bars import kernel_bar
    from fogwatch.terminal.live_table import make_display
    from fogwatch.terminal.summary_text import print_summary
    from patrol.summary.model import Summary

    def begin() -> None:
        ending.patience = 1  # the first ends the run in order, the second at once

    def over() -> None:
        ending.patience = ending.times  # one more, and no more files are written

    display = make_display(quiet)
    if preset is not None:
        display.say(f"preset {preset}: {PRESETS[preset]}")
    run_options = RunOptions(
        out,
        in_process,
        threads,
        port,
        display,
        begin=begin,
        stop=lambda: bool(ending),
        urgent=lambda: ending.times > 1,
        over=over,
        picture=picture,
        recording=recording,
        report=report,
        page=served,
        recovery=recovery,
        show_kernels=None if quiet else kernel_bar(Console(stderr=True)),
    )
    try:
        with naming(what, overridden), ending_children() if in_process else nullcontext():
            result = execute(scenario, run_options)
    except LaunchFailed as failed:
        complain(str(failed))
        return UNKNOWN
    with _readers_may_leave():
        if quiet:
            print(printable(str(result.folder)))
        else:
            print_summary(Console(), Summary.model_validate(result.summary), result.folder)
    return INTERRUPTED if ending else result.verdict.exit_code


@command(
    app,
    examples=["fogwatch demo"],
    exit_codes="as for fogwatch run: 0 verdict valid, 1 invalid, 2 bad input, 3 unknown, 130 interrupted",
    panel=START,
)
def demo() -> int:
    """Watch a fleet: five cars, each a process, patrol the terrain `site` for ten simulated minutes."""
    print("fogwatch run site --robots 5 --model car --duration 600")
    return run("site", robots=5, model="car", duration=600)


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"fogwatch {metadata.version('fogwatch')}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_print_version, help="Print the version and exit.")
    ] = False,
) -> None:
    """Take the options that stand before a command; see `app` for the help text."""


@command(app, examples=["fogwatch version"], panel=OTHER)
def version() -> None:
    """Print the versions of fogwatch, of Python and of the main libraries."""
    print(f"fogwatch {metadata.version('fogwatch')}")
    print(f"Python {platform.python_version()} on {platform.platform()}")
    for name in ("eclipse-zenoh", "numpy", "numba", "pydantic", "msgpack", "Pillow", "matplotlib", "scipy"):
        try:
            print(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            print(f"{name} not installed")


def main() -> int:
    """Run the command `fogwatch` with this process's arguments."""
    return run_app(app)


@contextmanager
def _readers_may_leave() -> Iterator[None]:
    """Print what may not be read to its end; the exit code stays the same."""
    try:
        yield
        sys.stdout.flush()
    except (BrokenPipeError, SystemExit):  # rich turns the first into the second
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _place(text: str) -> list[float]:
    """Read a start: X,Y or X,Y,HEADING."""
    try:
        place = [float(part) for part in text.split(",")]
    except ValueError:
        place = []
    if len(place) not in (2, 3):
        raise BadInput(f"--start {text}: expected X,Y or X,Y,HEADING in m and rad, for example --start 12.5,40")
    return place
