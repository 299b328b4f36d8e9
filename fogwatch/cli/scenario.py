"""``fogwatch scenario``: look at a scenario before anything runs. Commands raise BadInput; the caller prints it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from patrol.errors import BadInput
from patrol.radio.fleet_key import fleet_key
from patrol.scenario import Scenario, dump_scenario, open_scenario, parse_overrides, scenario_hash, scenario_schema

if TYPE_CHECKING:
    from worldsim.timeline import Timeline

app = typer.Typer(help="Show, check and describe scenario files.", no_args_is_help=True)

What = Annotated[str, typer.Argument(metavar="SCENARIO", help="A scenario file, a map or a built-in terrain.")]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="FIELD=VALUE", help="Override a field, e.g. patrol.dilatation=0. Repeatable."),
]


@app.command()
def show(what: What, settings: Settings = None) -> None:
    """Print the scenario with every default filled in, as a scenario file with units beside the fields."""
    typer.echo(dump_scenario(open_scenario(what, parse_overrides(settings or []))), nl=False)


@app.command()
def check(what: What, settings: Settings = None) -> None:
    """Say whether the scenario can run: values, terrain, the fleet's key, room for all; and what goes wrong when."""
    scenario = open_scenario(what, parse_overrides(settings or []))
    digest = scenario_hash(scenario)
    fleet_key(scenario)
    from patrol.prepare import prepare  # here: needs the simulator's libraries, which `show` does without

    prepared = prepare(scenario)
    area = float(prepared.patrolled.sum()) * scenario.point**2
    told = sum(spec.start is not None for spec in scenario.roster)
    typer.echo(f"{what}: can run")
    if len(scenario.roster) == 1:
        typer.echo(f"  1 robot, {'from a given start' if told else 'placed at random'}")
    else:
        typer.echo(f"  {len(scenario.roster)} robots, {told} of them from a given start, the others placed at random")
    typer.echo(f"  {area:.0f} m² to patrol on {prepared.terrain.name}, in points of {scenario.point:g} m")
    ticks = "1 tick" if scenario.ticks == 1 else f"{scenario.ticks} ticks"
    typer.echo(f"  {scenario.duration:g} s in {ticks} of {scenario.step:g} s")
    for line in _faults(scenario):
        typer.echo(f"  {line}")
    typer.echo(f"  scenario hash {digest}")


def _faults(scenario: Scenario) -> Iterator[str]:
    """What goes wrong, when and for whom: the faults as they are resolved."""
    if not scenario.faults:
        return
    from worldsim.timeline import Timeline

    timeline, step = Timeline(scenario), scenario.step
    count = "1 fault" if len(timeline.entries) == 1 else f"{len(timeline.entries)} faults"
    remains = _remains(scenario, timeline)
    if timeline.healed is None:
        yield f"{count}, to the end{f'; {remains}' if remains else ''}"
    elif remains:
        yield f"{count}, over at {timeline.healed * step:g} s, but {remains}"
    else:
        yield f"{count}, healed at {timeline.healed * step:g} s"
    for entry in timeline.entries:
        begin = f"{entry.begin * step:g}"
        to = "end" if entry.end is None else f"{entry.end * step:g} s"
        when = f"{begin} s" if entry.end == entry.begin else f"{begin} to {to}"
        yield f"  {entry.id:<10} {entry.fault.kind:<10} {when:<16} {timeline.describe(entry)}"


def _remains(scenario: Scenario, timeline: Timeline) -> str:
    """Who does not patrol at the end, and why; nothing when all do."""
    from patrol.journal.records import Status
    from worldsim.lifecycle import standing_at_the_end

    names = {spec.number: spec.name for spec in scenario.roster}
    standing = standing_at_the_end(timeline, names, scenario.ticks)
    told = []
    for status, words in ((Status.DEAD, "dead"), (Status.PAUSED, "paused"), (Status.LEFT, "away")):
        who = [names[number] for number, found in standing.items() if found is status]
        if who:
            all_of_many = len(who) == len(names) > 1
            verb = "stay" if len(who) > 1 else "stays"
            told.append(f"{'all' if all_of_many else ' '.join(who)} {verb} {words}")
    return ", ".join(told)


@app.command()
def schema(
    out: Annotated[Path | None, typer.Option(help="File to write, instead of the terminal.")] = None,
) -> None:
    """Print the JSON schema of scenario files, for editors that check as one types."""
    text = f"{json.dumps(scenario_schema(), indent=2)}\n"
    if out is None:
        typer.echo(text, nl=False)
        return
    try:
        out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise BadInput(f"{out}: cannot be written ({error.strerror}); choose another file") from None
