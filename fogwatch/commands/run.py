"""``fogwatch run`` and ``demo``: a fleet is run and judged. Commands raise BadInput; the caller prints it."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from typing import Annotated

from fogwatch.cli.command_help import command
from fogwatch.cli.ending import complain
from fogwatch.cli.options import argument, option
from fogwatch.run_options import PRESETS, Body, Changes, RunChoices
from patrol.errors import printable
from patrol.scenario import BUILTINS, MAX_ROBOTS, RobotGroup, Scenario, naming, open_scenario, with_spares
from runtime.process.failures import INTERRUPTED, UNKNOWN
from runtime.process.lifeline import ending_children, heed

PAGE_SPARES = 2
"""Number of robots that may join a run with a live page, unless the scenario or an option sets another."""

_SCENARIO = f"Scenario file, map file (map_server's YAML) or built-in terrain: {', '.join(BUILTINS)}."


@command(
    examples=["fogwatch demo"],
    exit_codes="as for fogwatch run: 0 verdict valid, 1 invalid, 2 bad input, 3 unknown, 130 interrupted",
)
def demo() -> int:
    """Watch a fleet: five cars, each a process, patrol the terrain `site` for ten simulated minutes."""
    print("fogwatch run site --robots 5 --model car --duration 600")
    return run("site", Changes(robots=5, body=Body(model="car"), duration=600), RunChoices())


@command(
    examples=[
        "fogwatch run yards --robots 5 --duration 600",
        "fogwatch run my-map.yaml --model differential --radius 0.3 --speed 1",
        "fogwatch run examples/yards-five.yaml --set patrol.options.dilatation=2 --seed 7",
        "fogwatch run yards --patrol tour --robots 5",
        "fogwatch run yards --preset paper --robots 5 --model holonomic",
    ],
    exit_codes="0 verdict valid, 1 verdict invalid, 2 bad input, 3 verdict unknown (the run could not be judged), 130 "
    "interrupted",
)
def run(
    what: Annotated[str, argument("SCENARIO", _SCENARIO)],
    changes: Changes,
    choices: RunChoices,
    quiet: Annotated[bool, option("", "Print nothing but the run folder.", "--quiet", panel="Output")] = False,
) -> int:
    """Run a fleet, one process per robot, and judge the run.

    Options override the settings of a scenario file. A map file or a built-in terrain has no settings: unless options
    say otherwise, five cars with a radius of 1 m patrol it for 5000 s.
    """
    ending = heed(None, patience=0)
    overrides = changes.overrides()
    choices = replace(choices, page=choices.page and not quiet and not choices.in_process)
    scenario = _with_spares(open_scenario(what, overrides), changes.spare, choices.page)
    changes.body.check(scenario)

    from rich.console import Console

    from fogwatch.api import RunOptions, execute
    from fogwatch.launch.launcher import LaunchFailed
    from fogwatch.terminal.live_table import kernel_bar, make_display
    from fogwatch.terminal.summary_text import print_files, print_summary
    from patrol.summary.model import Summary

    def begin() -> None:
        ending.patience = 1  # the first ends the run in order, the second at once

    def over() -> None:
        ending.patience = ending.times  # one more, and no more files are written

    def judged(summary: Summary) -> None:
        if not quiet:
            with _readers_may_leave():
                print_summary(Console(), summary)

    display = make_display(quiet)
    if changes.preset is not None:
        display.say(f"preset {changes.preset}: {PRESETS[changes.preset]}")
    options = RunOptions(
        **vars(choices),
        display=display,
        begin=begin,
        stop=lambda: bool(ending),
        urgent=lambda: ending.times > 1,
        over=over,
        judged=judged,
        show_kernels=None if quiet else kernel_bar(Console(stderr=True)),
    )
    try:
        with naming(what, overrides), ending_children() if choices.in_process else nullcontext():
            result = execute(scenario, options)
    except LaunchFailed as failed:
        complain(str(failed))
        return UNKNOWN
    with _readers_may_leave():
        if quiet:
            print(printable(str(result.folder)))
        else:
            print_files(Console(), result.folder)
    return INTERRUPTED if ending else result.verdict.exit_code


def _with_spares(scenario: Scenario, spare: int | None, has_page: bool) -> Scenario:
    """Return a scenario with the spare robots that were asked for, or with those of a live page."""
    if spare is not None:
        return with_spares(scenario, spare)
    if has_page and isinstance(scenario.robots, RobotGroup) and scenario.robots.spare is None:
        return with_spares(scenario, min(PAGE_SPARES, MAX_ROBOTS - scenario.robots.count))
    return scenario


@contextmanager
def _readers_may_leave() -> Iterator[None]:
    """Print what may not be read to its end; the exit code stays the same."""
    try:
        yield
        sys.stdout.flush()
    except (BrokenPipeError, SystemExit):  # rich turns the first into the second
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
