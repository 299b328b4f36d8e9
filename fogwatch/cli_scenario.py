"""``fogwatch scenario``: look at a scenario before anything runs. Commands raise BadInput; the caller prints it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from patrol.errors import BadInput
from patrol.scenario import Scenario, dump_scenario, open_scenario, parse_overrides, scenario_hash, scenario_schema

app = typer.Typer(help="Show, check and describe scenario files.", no_args_is_help=True)

What = Annotated[
    str, typer.Argument(metavar="SCENARIO|MAP.yaml|BUILTIN", help="A scenario file, a map or a built-in terrain.")
]
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
    """Say whether the scenario can run: every value, the terrain, room for every robot; and what goes wrong when."""
    scenario = open_scenario(what, parse_overrides(settings or []))
    digest = scenario_hash(scenario)
    from patrol.prepare import prepare  # here: needs the simulator's libraries, which `show` does without

    prepared = prepare(scenario)
    area = float(prepared.patrolled.sum()) * scenario.point**2
    told = sum(spec.start is not None for spec in scenario.roster)
    typer.echo(f"{what}: can run")
    typer.echo(f"  {len(scenario.roster)} robots, {told} of them from a given start, the others placed at random")
    typer.echo(f"  {area:.0f} m² to patrol on {prepared.terrain.name}, in points of {scenario.point:g} m")
    typer.echo(f"  {scenario.duration:g} s in {scenario.ticks} ticks of {scenario.step:g} s")
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
    healed = "to the end" if timeline.healed is None else f"healed at {timeline.healed * step:g} s"
    yield f"{count}, {healed}"
    for entry in timeline.entries:
        begin = f"{entry.begin * step:g}"
        to = "end" if entry.end is None else f"{entry.end * step:g} s"
        when = f"{begin} s" if entry.end == entry.begin else f"{begin} to {to}"
        yield f"  {entry.id:<10} {entry.fault.kind:<10} {when:<16} {timeline.describe(entry)}"


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
