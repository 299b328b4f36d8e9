"""``fogwatch map``: look at a map before anything runs. Commands raise BadInput; the caller prints it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from fogwatch.cli.command_help import command, group
from fogwatch.cli.options import option
from patrol.errors import BadInput, did_you_mean
from patrol.files.yaml_text import parse_yaml, read_text
from patrol.ground.terrain import Terrain
from patrol.maps.builtins import LAYOUTS, builtin_terrain
from patrol.pose import Pose
from patrol.printable import printable
from patrol.scenario import load_scenario
from patrol.starting.seldom import SELDOM
from patrol.starting.warmup import warm

if TYPE_CHECKING:
    from fogwatch.grounds.map_check import MapReport, SealedPart
    from patrol.ground.doors import Door
    from patrol.prepare import Prepared
    from patrol.scenario import DockSpec

app = group(
    "map",
    "Check what a robot can reach and see on a map, split it into regions, find where it lies on another, or make maps "
    "of random buildings.",
)

MOST_LINES = 20
"""Sealed parts listed at most, and doors."""


def named_terrain(what: str, point: float) -> Terrain:
    """Return the terrain of a map's YAML file, or one of `LAYOUTS`, with points of side `point`, m."""
    if what in LAYOUTS:
        return builtin_terrain(what, point)
    try:
        is_there = Path(what).exists()
    except OSError:  # such as a name that is too long
        is_there = False
    if not is_there:
        raise BadInput(f"{what}: no such map file, and no built-in terrain; {did_you_mean(what, tuple(LAYOUTS))}")
    from patrol.maps.load import read_terrain

    return read_terrain(Path(what), point)


@command(app, examples=["fogwatch map check yards --radius 0.5 --picture yards.png"])
def check(
    what: Annotated[str, typer.Argument(metavar="MAP.yaml|BUILTIN", help=f"Map file, or one of {', '.join(LAYOUTS)}.")],
    radius: Annotated[float, option("M", "Body radius in m.")] = 1.0,
    point: Annotated[float, option("M", "Side of one grid point in m.")] = 0.1,
    sensor_range: Annotated[float, option("M", "Sensor range in m.", "--range")] = 10.0,
    line_of_sight: Annotated[
        bool, option("", "Whether obstacles block the sensor.", "--line-of-sight/--through-walls")
    ] = True,
    start: Annotated[
        list[str] | None, option("X,Y", "Where a robot starts, in m (default: chosen as for a run). Repeatable.")
    ] = None,
    picture: Annotated[Path | None, option("OUT.png", "Draw the result into this PNG file.")] = None,
    zones: Annotated[Path | None, option("FILE", "Zones to check: a zones.yaml, or a scenario that has some.")] = None,
    closures: Annotated[
        Path | None, option("FILE", "Closures to check: a closures.yaml, or a scenario that has some.")
    ] = None,
    docks: Annotated[Path | None, option("FILE", "Docks to draw, with --picture: a scenario that has some.")] = None,
    robots: Annotated[int, option("N", "Robots that are to keep wanted ages, with --zones.")] = 5,
    speed: Annotated[float, option("M", "Their speed in m/s, with --zones.")] = 1.0,
) -> None:
    """Report how much of a map a robot can reach and see, what is sealed off and why, and the narrowest doors."""
    for name, value in (("radius", radius), ("point", point), ("range", sensor_range)):
        if not (math.isfinite(value) and value > 0.0):
            raise BadInput(f"--{name} = {value:g}: expected a finite number above 0, in m")
    starts = [_read_start(text) for text in start or []]
    warm(("patrol",), lambda line: typer.echo(line, err=True), SELDOM)
    from fogwatch.grounds.map_check import check_map  # here: it imports kernels, which are compiled first
    from patrol.maps.doubts import doubts

    terrain = named_terrain(what, point)
    report = check_map(terrain, radius, sensor_range, line_of_sight, starts)
    about: list[str] = []
    site: dict[str, Any] = {}
    body = {"count": robots, "model": "holonomic", "radius": radius, "speed": speed}
    placed = {"starts": [[start.x, start.y] for start in starts[:robots]]} if starts else {}
    sensor = {"range": sensor_range, "line_of_sight": line_of_sight}
    fleet = {"terrain": _terrain_settings(what), "point": point, "robots": {**body, **placed}, "sensor": sensor}
    if docks is not None:
        if picture is None:
            raise BadInput(f"--docks {docks}: has an effect only with --picture; give it, or drop this one")
        site["docks"] = _read_docks(what, docks)
    if zones is not None:
        from fogwatch.grounds.scenario_notes import zone_lines  # here, as most checks have no zones

        prepared = _prepare_fleet(fleet, "zones", zones)
        before, report = report, check_map(prepared.terrain, radius, sensor_range, line_of_sight, starts)
        about = list(zone_lines(prepared, before, report))
        site["zones"] = prepared.scenario.zones
    if closures is not None:
        from fogwatch.grounds.scenario_notes import closure_lines  # here, as most checks have no closures

        closing = _prepare_fleet(fleet, "closures", closures)
        about += closure_lines(closing)
        site["closures"] = closing.scenario.closures
    for line in doubts(terrain):
        typer.echo(printable(f"warning: {line}"), err=True)
    console = Console()
    if console.is_terminal:
        _print_tables(console, report)
    else:
        for line in plain_lines(report):
            typer.echo(line)
    for line in about:
        typer.echo(printable(line))
    if picture is not None:
        from fogwatch.pictures.run_end import map_picture  # here: its library is an extra
        from patrol.scenario.marks import marks_of

        map_picture(report, picture, marks_of(site, report.terrain))
        typer.echo(printable(f"picture: {picture}"))


def plain_lines(report: MapReport) -> Iterator[str]:
    """Yield the result of a map check as lines of text."""
    yield f"{_terrain_headline(report.terrain)}; {_body_text(report)}"
    for label, value, remark in _area_rows(report):
        yield f"  {label:<12} {value:10.1f} m²  {remark}".rstrip()
    yield _sealed_headline(report)
    for number, part in enumerate(report.parts[:MOST_LINES], start=1):
        yield f"  {number}: {part.area:.1f} m² around {_place(part)}: {_why_sealed(part)}"
    yield _doors_headline(report)
    for door in report.doors[:MOST_LINES]:
        yield f"  {door.width:.2f} m at {_place(door)}: {_max_radius(door)}, {_door_consequence(door)}"


def _terrain_headline(terrain: Terrain) -> str:
    """The terrain's name and size."""
    xmin, ymin, xmax, ymax = terrain.bounds
    about = (
        f" ({LAYOUTS[terrain.name].about}; a reconstruction of the paper's terrain)" if terrain.name in LAYOUTS else ""
    )
    size = f"{xmax - xmin:g} x {ymax - ymin:g} m, {terrain.width} x {terrain.height} points of {terrain.point:g} m"
    return f"{terrain.name}{about}: {size}"


def _body_text(report: MapReport) -> str:
    """The body and the sensor that the report holds for."""
    sight = "line of sight" if report.line_of_sight else "through walls"
    return f"body radius {report.radius:g} m, sensor range {report.sensor_range:g} m, {sight}"


def _area_rows(report: MapReport) -> list[tuple[str, float, str]]:
    """The report's areas: label, area in m² and remark of each."""
    blind = max(report.unseen - report.unseen_sealed, 0.0)
    unseen = f"{report.unseen_sealed:.1f} m² in sealed-off parts, {blind:.1f} m² in blind corners"
    return [
        ("free", report.free, ""),
        ("fits", report.fits, "where the body's centre may be"),
        ("reachable", report.reachable, "the part of it that can be reached from the starts"),
        ("patrolled", report.patrolled, "what can be seen from there; MFoW counts this"),
        ("never seen", report.unseen, unseen if report.unseen > 0.0 else ""),
    ]


def _sealed_headline(report: MapReport) -> str:
    """Tell the number of parts that are sealed off."""
    small_parts = f"{report.small_parts} small part{'s' if report.small_parts > 1 else ''}"
    small = f"{small_parts} of {report.small_area:.1f} m² in total" if report.small_parts else ""
    if not report.parts:
        return f"sealed off: nothing but {small}" if small else "sealed off: nothing"
    parts = f"{len(report.parts)} part{'s' if len(report.parts) > 1 else ''}"
    shown = f", the largest {MOST_LINES}" if len(report.parts) > MOST_LINES else ""
    return f"sealed off: {parts}{shown}{f', and {small}' if small else ''}"


def _why_sealed(part: SealedPart) -> str:
    """Tell why a part cannot be reached, and how much of it is seen from outside."""
    reason = part.reason
    if part.door is not None:
        reason = f"its door at {_place(part.door)} is too narrow, {part.door.width:.2f} m, and {_max_radius(part.door)}"
    where = "; touches the map's border" if part.at_border else ""
    return f"{reason}{where}; {_seen_share(part)} of it is seen from outside"


def _doors_headline(report: MapReport) -> str:
    """Tell the number of doors."""
    if not report.doors:
        return "doors: none; no narrow passage limits what can be reached"
    shown = f", the narrowest {MOST_LINES}" if len(report.doors) > MOST_LINES else ", narrowest first"
    return (
        f"doors: {len(report.doors)}{shown}; narrower ways between the same rooms are left out; widths count whole "
        "free points, and a body needs half a point more than its radius, so a smaller --point may open a narrow door"
    )


def _max_radius(door: Door) -> str:
    """The largest radius that passes a door, rounded down so that it does."""
    return f"lets a radius of {math.floor(100.0 * door.radius + 1e-6) / 100.0:.2f} m pass"


def _door_consequence(door: Door) -> str:
    """Tell the area that depends on a door."""
    return f"{'a wider body loses' if door.passes else 'this body loses'} {door.behind:.1f} m²"


def _place(at: SealedPart | Door) -> str:
    """Coordinates in m."""
    return f"({at.x:.2f}, {at.y:.2f})"


def _seen_share(part: SealedPart) -> str:
    if part.seen == 0.0:
        return "nothing"
    percent = min(math.floor(100.0 * part.seen / part.area), 99)
    return "all" if part.seen == part.area else f"{percent} %" if percent else "less than 1 %"


def _print_tables(console: Console, report: MapReport) -> None:
    console.print(_terrain_headline(report.terrain), style="bold", highlight=False, markup=False)
    console.print(_body_text(report), highlight=False)
    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column(style="cyan")
    table.add_column(justify="right")
    table.add_column(style="dim")
    for label, value, remark in _area_rows(report):
        table.add_row(label, f"{value:.1f} m²", remark)
    console.print(table)
    console.print(f"\n[bold]{_sealed_headline(report)}[/bold]", highlight=False)
    if report.parts:
        rows = [
            (str(number), f"{part.area:.1f}", _place(part), _why_sealed(part))
            for number, part in enumerate(report.parts[:MOST_LINES], start=1)
        ]
        console.print(_make_table(("#", "m²", "around (m)", "why"), rows))
    console.print(f"\n[bold]{_doors_headline(report)}[/bold]", highlight=False)
    if report.doors:
        lines = [
            (f"{door.width:.2f}", _place(door), _yes_or_no(door.passes), _max_radius(door), f"{door.behind:.1f}")
            for door in report.doors[:MOST_LINES]
        ]
        console.print(_make_table(("width (m)", "at (m)", "passes", "", "m² behind"), lines))


def _make_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    table = Table(*header, box=None, pad_edge=False, header_style="cyan")
    for row in rows:
        table.add_row(*row)
    return table


def _yes_or_no(passes: bool) -> str:
    return "yes" if passes else "[red]no[/red]"


def _terrain_settings(what: str) -> dict[str, str]:
    """Return a map, or a built-in terrain, as a scenario names it."""
    return {"builtin": what} if what in LAYOUTS else {"map": str(Path(what).absolute())}


def _prepare_fleet(fleet: Mapping[str, object], listed: str, file: Path) -> Prepared:
    """Return a fleet on a map with the zones or closures of a file."""
    from patrol.prepare import prepare
    from patrol.scenario import naming

    options = {"robots.count": "--robots", "robots.speed": "--speed", listed: f"--{listed} {file}"}
    scenario = load_scenario({**fleet, listed: str(file.absolute())}, called="options", aliases=options)
    with naming(f"--{listed} {file}", fleet.keys()):
        return prepare(scenario)


def _read_docks(what: str, file: Path) -> tuple[DockSpec, ...]:
    """Return the docks of a scenario file."""
    says = parse_yaml(read_text(file), str(file))
    listed = says.get("docks") if isinstance(says, dict) else None
    if not listed:
        raise BadInput(f"--docks {file}: has no docks; write for example 'docks: [{{place: [1, 7]}}]'")
    body = {"count": 1, "battery": {"capacity": 1000, "idle": 1, "charge": 1000}}
    return load_scenario(
        {"terrain": _terrain_settings(what), "robots": body, "docks": listed}, called=f"--docks {file}"
    ).docks


def _read_start(text: str) -> Pose:
    parts = text.split(",")
    try:
        x, y = (float(part) for part in parts[:2])
    except ValueError:
        x = y = math.nan
    if len(parts) not in (2, 3) or not (math.isfinite(x) and math.isfinite(y)):
        raise BadInput(f"--start = {text}: expected X,Y in m, for example 12.5,3")
    return Pose(x, y, 0.0)
