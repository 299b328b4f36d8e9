"""``fogwatch scenario``: look at a scenario before it runs. Commands raise BadInput; the caller prints it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fogwatch.cli.command_help import command, group
from fogwatch.cli.ending import say
from fogwatch.cli.options import argument, option
from fogwatch.run_options import PRESETS, overrides_of, patrol_option, settings_option
from patrol.errors import printable
from patrol.files.whole_file import writing
from patrol.scenario import Scenario, dump_scenario, naming, open_scenario, scenario_hash, scenario_schema
from patrol.scenario.assumptions import assumption_lines
from patrol.scenario.patrols import describe_patrol
from patrol.scenario.policies import BUILT_IN, LearnedPatrol
from patrol.scenario.radio_spec import MODELS
from patrol.scenario.sections import BUILT_IN_SENSORS, VERTICES
from runtime.security.private_files import fleet_key

if TYPE_CHECKING:
    from worldsim.faults import Timeline

app = group("scenario", "Print or check a scenario, or print the JSON schema of scenario files.")

What = Annotated[str, argument("SCENARIO", "Scenario file, map file or built-in terrain.")]
_SET = "Set a field, such as patrol.options.separation=none. Repeatable."
Settings = Annotated[list[str] | None, settings_option(_SET)]
Patrol = Annotated[str | None, patrol_option()]
Preset = Annotated[str | None, option("|".join(PRESETS), "As for fogwatch run; --set holds over it.")]


@command(
    app,
    "show",
    examples=["fogwatch scenario show yards > yards.yaml", "fogwatch scenario show yards --preset paper > paper.yaml"],
)
def print_scenario(what: What, settings: Settings = None, patrol: Patrol = None, preset: Preset = None) -> None:
    """Print a scenario as a scenario file, with every default filled in and the units beside the fields."""
    typer.echo(dump_scenario(open_scenario(what, overrides_of(settings, patrol, preset))), nl=False)


@command(
    app,
    examples=["fogwatch scenario check examples/yards-five.yaml --set robots.count=8"],
    exit_codes="0 the scenario can run, 2 it cannot",
)
def check(what: What, settings: Settings = None, patrol: Patrol = None) -> None:
    """Check whether a scenario can run, and list its faults.

    The check covers the values, the terrain, the fleet's key, and the room for all robots at the start. A policy,
    sensor or radio model of one's own is looked for and not run, so its options are checked only when the scenario
    runs.
    """
    overrides = overrides_of(settings, patrol)
    scenario = open_scenario(what, overrides)
    digest = scenario_hash(scenario)
    fleet_key(scenario.radio.key)
    from fogwatch.grounds.scenario_notes import scenario_notes
    from fogwatch.own_classes import named_classes  # here: needs libraries that `fogwatch scenario show` does without
    from patrol.classes.static_check import check_without_running
    from patrol.prepare import prepare

    with naming(what, overrides):
        prepared = prepare(scenario)
    if any(zone.age is not None for zone in scenario.zones):
        from patrol.measures.zoned import zone_weights

        zone_weights(prepared)
    for named, _ in named_classes(scenario):
        check_without_running(named)
    if isinstance(scenario.patrol, LearnedPatrol):
        scenario.patrol.options.read_weights()
    fixed = sum(spec.start is not None for spec in scenario.roster)
    say(f"{what}: can run")
    say(f"  {_starts_text(len(scenario.roster), fixed)}")
    for line in assumption_lines(scenario):
        say(f"  {line}")
    unchecked = "" if scenario.patrol.policy in BUILT_IN else ", not run: a run checks its options"
    say(f"  patrol: {describe_patrol(scenario.patrol.policy)}{unchecked}")
    if scenario.sensor.kind not in BUILT_IN_SENSORS:
        say(f"  sensor {printable(scenario.sensor.kind)}, not run: a run checks its options")
    if scenario.radio.model not in MODELS:
        say(f"  radio model {printable(scenario.radio.model)}, not run: a run checks its options")
    ground = f"{float(prepared.patrolled.sum()) * scenario.point**2:.0f} m²"
    if scenario.terrain.graph is not None and scenario.terrain.patrolled == VERTICES:
        ground = f"{len(scenario.terrain.graph.vertices)} vertices"
    say(f"  {ground} to patrol on {prepared.terrain.name}, points of {scenario.point:g} m")
    ticks = "1 tick" if scenario.ticks == 1 else f"{scenario.ticks} ticks"
    say(f"  {scenario.duration:g} s in {ticks} of {scenario.step:g} s")
    for line in scenario_notes(prepared):
        say(f"  warning: {line}")
    if not scenario.docks and any(spec.battery is not None for spec in scenario.roster):
        say("  no docks, so batteries are never charged")
    for line in _fault_lines(scenario):
        say(f"  {line}")
    say(f"  scenario hash {digest}")


def _starts_text(robots: int, given: int) -> str:
    """Describe the number of robots, and how many of them start at a given place."""
    count = "1 robot" if robots == 1 else f"{robots} robots"
    if given == 0:
        return f"{count}, placed at random"
    starts = "a given start" if given == 1 else "given starts"
    mixed = f"{count}, {given} of them at {starts}, the others placed at random"
    return f"{count}, at {starts}" if given == robots else mixed


def _fault_lines(scenario: Scenario) -> Iterator[str]:
    """The resolved faults: what happens, when and to whom."""
    if not scenario.faults:
        return
    from worldsim.faults import Timeline

    timeline, step = Timeline(scenario), scenario.step
    count = "1 fault" if len(timeline.entries) == 1 else f"{len(timeline.entries)} faults"
    remains = _remaining_text(scenario, timeline)
    if timeline.healed is None:
        yield f"{count}, until the end{f'; {remains}' if remains else ''}"
    elif remains:
        yield f"{count}, over at {timeline.healed * step:g} s, but {remains}"
    else:
        yield f"{count}, healed at {timeline.healed * step:g} s"
    for entry in timeline.entries:
        begin = f"{entry.begin * step:g}"
        to = "end" if entry.end is None else f"{entry.end * step:g} s"
        when = f"{begin} s" if entry.end == entry.begin else f"{begin} to {to}"
        yield f"  {entry.id:<10} {entry.fault.kind:<10} {when:<16} {timeline.describe(entry)}"


def _remaining_text(scenario: Scenario, timeline: Timeline) -> str:
    """Which robots do not patrol at the end, and why; empty when all do."""
    from patrol.journal.records import Status
    from worldsim.faults import standing_at_the_end

    names = {spec.number: spec.name for spec in scenario.roster}
    standing = standing_at_the_end(timeline, names, scenario.ticks)
    parts = []
    for status, words in ((Status.DEAD, "dead"), (Status.PAUSED, "paused"), (Status.LEFT, "away")):
        who = [names[number] for number, state in standing.items() if state is status]
        if who:
            all_of_many = len(who) == len(names) > 1
            verb = "stay" if len(who) > 1 else "stays"
            parts.append(f"{'all' if all_of_many else ' '.join(who)} {verb} {words}")
    return ", ".join(parts)


@command(app, examples=["fogwatch scenario schema --out scenario-schema.json"])
def schema(out: Annotated[Path | None, option("FILE", "File to write (default: print the schema).")] = None) -> None:
    """Print the JSON schema of scenario files, with which an editor checks and completes them."""
    text = f"{json.dumps(scenario_schema(), indent=2)}\n"
    if out is None:
        typer.echo(text, nl=False)
        return
    with writing(out):
        out.write_text(text, encoding="utf-8")
