"""``fogwatch map``: look at a map before anything runs. Commands raise BadInput; the caller prints it."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from fogwatch.cli.command_help import command, group
from fogwatch.cli.ending import note, say
from fogwatch.cli.options import argument, bounded, option
from fogwatch.run_options import read_start
from patrol.errors import BadInput, did_you_mean
from patrol.files.whole_file import writing
from patrol.files.yaml_text import parse_yaml, read_text
from patrol.ground.terrain import Terrain
from patrol.maps.builtins import LAYOUTS, builtin_terrain
from patrol.pose import Pose
from patrol.scenario import load_scenario, naming, open_scenario
from runtime.starting.warmup import SELDOM, warm

if TYPE_CHECKING:
    from fogwatch.grounds.map_align import Place
    from fogwatch.grounds.map_check import MapReport, SealedPart
    from patrol.energy.spec import DockSpec
    from patrol.ground.doors import Door
    from patrol.prepare import Prepared
    from patrol.regions.split import RegionSplit

app = group(
    "map", "Check what a robot can reach and see on a map, split it into regions, or find where it lies on another."
)

MOST_LINES = 20
"""Sealed parts listed at most, and doors, and regions."""

LEAST_M, MOST_M = 0.001, 100_000.0
"""Lengths that options take, m."""
MOST_OFF_M = 10.0
"""The largest tolerance of landmarks, m."""

Point = Annotated[float, bounded("M", "Side of one grid point in m.", LEAST_M, MOST_M)]

APART_TOLERANCES = 10.0
"""Distance of the farthest two landmarks at least, in tolerances."""


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
    what: Annotated[str, argument("MAP.yaml|BUILTIN", f"Map file, or one of {', '.join(LAYOUTS)}.")],
    radius: Annotated[float, bounded("M", "Body radius in m.", LEAST_M, MOST_M)] = 1.0,
    point: Point = 0.1,
    sensor_range: Annotated[float, bounded("M", "Sensor range in m.", LEAST_M, MOST_M, "--range")] = 10.0,
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
    _check_picture(picture)
    starts = [Pose(x, y, 0.0) for x, y, *_ in map(read_start, start or ())]
    warm(("patrol",), note, SELDOM)
    from fogwatch.grounds.map_check import check_map  # here: it imports kernels, which are compiled first
    from patrol.maps.doubts import doubts

    terrain = named_terrain(what, point)
    _check_picture(picture, (terrain,))
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
        note(f"warning: {line}")
    for line in (*_report_lines(report), *about):
        say(line)
    if picture is not None:
        from fogwatch.pictures.maps import map_picture  # here: its library is an extra
        from patrol.scenario.marks import marks_of

        map_picture(report, picture, marks_of(site, report.terrain))
        say(f"picture: {picture}")


def _report_lines(report: MapReport) -> Iterator[str]:
    """Yield the result of a map check as lines of text."""
    terrain = report.terrain
    xmin, ymin, xmax, ymax = terrain.bounds
    layout = LAYOUTS.get(terrain.name) if terrain.source is None else None
    about = f" ({layout.about}; a reconstruction of the paper's terrain)" if layout is not None else ""
    size = f"{xmax - xmin:g} x {ymax - ymin:g} m, {terrain.width} x {terrain.height} points of {terrain.point:g} m"
    sight = "line of sight" if report.line_of_sight else "through walls"
    body = f"body radius {report.radius:g} m, sensor range {report.sensor_range:g} m, {sight}"
    yield f"{terrain.name}{about}: {size}; {body}"
    blind = max(report.unseen - report.unseen_sealed, 0.0)
    unseen = f"{report.unseen_sealed:.1f} m² in sealed-off parts, {blind:.1f} m² in blind corners"
    areas = (
        ("free", report.free, ""),
        ("fits", report.fits, "where the body's centre may be"),
        ("reachable", report.reachable, "the part of it that can be reached from the starts"),
        ("patrolled", report.patrolled, "what can be seen from there; MFoW counts this"),
        ("never seen", report.unseen, unseen if report.unseen > 0.0 else ""),
    )
    for label, value, remark in areas:
        yield f"  {label:<12} {value:10.1f} m²  {remark}".rstrip()
    yield _sealed_headline(report)
    for number, part in enumerate(report.parts[:MOST_LINES], start=1):
        yield f"  {number}: {part.area:.1f} m² around {_place(part)}: {_why_sealed(part)}"
    yield _doors_headline(report)
    for door in report.doors[:MOST_LINES]:
        loses = "a wider body loses" if door.passes else "this body loses"
        yield f"  {door.width:.2f} m at {_place(door)}: {_max_radius(door)}, {loses} {door.behind:.1f} m²"


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


def _place(at: SealedPart | Door) -> str:
    """Coordinates in m."""
    return f"({at.x:.2f}, {at.y:.2f})"


def _seen_share(part: SealedPart) -> str:
    if part.seen == 0.0:
        return "nothing"
    percent = min(math.floor(100.0 * part.seen / part.area), 99)
    return "all" if part.seen == part.area else f"{percent} %" if percent else "less than 1 %"


def _terrain_settings(what: str) -> dict[str, str]:
    """Return a map, or a built-in terrain, as a scenario names it."""
    return {"builtin": what} if what in LAYOUTS else {"map": str(Path(what).absolute())}


def _prepare_fleet(fleet: Mapping[str, object], listed: str, file: Path) -> Prepared:
    """Return a fleet on a map with the zones or closures of a file."""
    from patrol.prepare import prepare

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
    mapping = {"terrain": _terrain_settings(what), "robots": body, "docks": listed}
    return load_scenario(mapping, called=f"--docks {file}").docks


@command(
    app, examples=["fogwatch map align robot.yaml site.yaml --landmark 0.4,1.2=12.5,3 --landmark 7.9,1.2=12.5,10.5"]
)
def align(
    own: Annotated[str, argument("A", "The robot's map: a map file.")],
    ours: Annotated[str, argument("B", f"Our map: a map file, or one of {', '.join(LAYOUTS)}.")],
    landmark: Annotated[
        list[str], option("AX,AY=BX,BY", "Place on A that is a place on B, in m. Repeatable; two or more.")
    ],
    tolerance: Annotated[float, bounded("M", "How far landmarks may be off in m.", LEAST_M, MOST_OFF_M)] = 0.3,
    point: Point = 0.1,
    picture: Annotated[Path | None, option("OUT.png", "Draw the maps over each other into this PNG file.")] = None,
) -> None:
    """Find where a robot's own map A lies on our map B: how far it is shifted and turned.

    By landmarks that both maps show, such as corners of rooms, far from each other. The last line is the option that an
    agent of a robot with map A needs on map B (fogwatch agent --robot ros2). Look at the picture before you drive.
    """
    pairs = [_read_pair(text) for text in landmark]
    _check_picture(picture)
    warm(("patrol",), note, SELDOM)
    from fogwatch.grounds import map_align  # here: its library takes a while

    terrain_a, terrain_b = named_terrain(own, point), named_terrain(ours, point)
    _check_picture(picture, (terrain_a, terrain_b))
    a, b = map_align.wall_map(terrain_a), map_align.wall_map(terrain_b)
    _check_places(pairs, (terrain_a, terrain_b), tolerance)
    transform, off_m = map_align.fit_landmarks(pairs)
    for number, (text, off) in enumerate(zip(landmark, off_m, strict=True), start=1):
        say(f"landmark {number}, {text}: off by {off:.2f} m")
    if max(off_m) > tolerance:
        raise BadInput(
            f"--landmark {landmark[off_m.index(max(off_m))]}: off by {max(off_m):.2f} m, and --tolerance is "
            f"{tolerance:g} m; correct the landmarks, of which at least one is wrong"
        )
    agree = map_align.agreement(a, b, transform)
    say(f"walls that agree: {agree:.0%}")
    if agree < map_align.LEAST_AGREEMENT:
        note("few walls agree at these landmarks; look at --picture before you drive by it")
    if picture is not None:
        from fogwatch.pictures.maps import overlay_picture  # here: its library is an extra

        overlay_picture((terrain_a.name, terrain_b.name), a, b, transform, [on_b for _, on_b in pairs], picture)
        say(f"picture: {picture}")
    turned = f"turned by {transform.heading:.4f} rad ({math.degrees(transform.heading):.1f} degrees)"
    say(f"{own} on {ours}: its (0, 0) is at ({transform.x:.3f}, {transform.y:.3f}) m, {turned}")
    say(f"--transform={map_align.spelled(transform)}")


def _check_places(pairs: list[tuple[Place, Place]], terrains: tuple[Terrain, Terrain], tolerance: float) -> None:
    """Refuse landmarks off their map, and landmarks so near to each other that they say little of the turn."""
    for terrain, places in zip(terrains, zip(*pairs, strict=True), strict=True):
        xmin, ymin, xmax, ymax = terrain.bounds
        for x, y in places:
            if not (xmin <= x <= xmax and ymin <= y <= ymax):
                span = f"spans x {xmin:g} to {xmax:g} m and y {ymin:g} to {ymax:g} m"
                raise BadInput(f"--landmark: ({x:g}, {y:g}) is not on {terrain.name}, which {span}")
    apart = max(math.dist(first, second) for first, _ in pairs for second, _ in pairs)
    if len(pairs) > 1 and apart < APART_TOLERANCES * tolerance:
        needed_m = APART_TOLERANCES * tolerance
        raise BadInput(
            f"--landmark: all lie within {apart:.2f} m on A; give some at least {needed_m:g} m apart, "
            "or a smaller --tolerance"
        )


def _check_picture(picture: Path | None, terrains: tuple[Terrain, ...] = ()) -> None:
    """Refuse a picture that cannot be written, that is no PNG by its name, or that is one of the maps' own files."""
    from monitor.replay.run_files import check_out
    from patrol.maps.map_file import read_map_file

    if picture is None:
        return
    check_out(picture, "map.png")
    if picture.suffix.lower() != ".png":
        raise BadInput(f"--picture {picture}: expected a name that ends in .png")
    for terrain in terrains:
        if terrain.source is not None:
            image = read_map_file(terrain.source).image
            if picture.resolve() in (image.resolve(), Path(terrain.source).resolve()):
                raise BadInput(f"--picture {picture}: is a file of the map {terrain.name}; give another name")


def _read_pair(text: str) -> tuple[Place, Place]:
    places = [part.split(",") for part in text.split("=")]
    try:
        (ax, ay), (bx, by) = ((float(x), float(y)) for x, y in places)
    except ValueError:
        ax = ay = bx = by = math.nan
    if not all(map(math.isfinite, (ax, ay, bx, by))):
        raise BadInput(f"--landmark {text}: expected AX,AY=BX,BY in m, for example 0.4,1.2=12.5,3")
    return (ax, ay), (bx, by)


@command(app, examples=["fogwatch map regions yards --picture regions.png --polygons regions.yaml"])
def regions(
    what: Annotated[str, argument("SCENARIO", f"Scenario file, map file or one of {', '.join(LAYOUTS)}.")],
    point: Annotated[
        float | None, bounded("M", "Side of one grid point in m (default: the scenario's, or 0.1).", LEAST_M, MOST_M)
    ] = None,
    radius: Annotated[
        float | None, bounded("M", "Body radius in m (default: the largest of the robots, or 1).", LEAST_M, MOST_M)
    ] = None,
    picture: Annotated[Path | None, option("OUT.png", "Draw the regions into this PNG file.")] = None,
    polygons: Annotated[
        Path | None, option("OUT.yaml", "Write the regions as the patrol section of a scenario.")
    ] = None,
) -> None:
    """Split a map into convex regions, or check the regions that a scenario gives.

    Robots use them with the policy potential-field and patrol.options.paths: regions.
    """
    _check_picture(picture)
    field_lengths_m = {"point": point, "robots.radius": radius}
    overrides = {field: value for field, value in field_lengths_m.items() if value is not None}
    scenario = open_scenario(what, overrides)
    widest = max(spec.radius for spec in scenario.roster)
    warm(("patrol",), note, SELDOM)
    from patrol.ground.cspace import cspace_of  # here: these import kernels, which are compiled first
    from patrol.prepare import terrain_of
    from patrol.regions.split import regions_by_hand, split_regions

    with naming(what, overrides):
        terrain = terrain_of(scenario)
    body = cspace_of(terrain, widest)
    by_hand = scenario.patrol.regions
    begun = time.perf_counter()
    split = split_regions(terrain, body) if by_hand is None else regions_by_hand(terrain, by_hand)
    split = split.for_body(terrain, body)
    took = time.perf_counter() - begun
    for line in _region_lines(terrain, widest, split, took, by_hand is not None):
        say(line)
    if polygons is not None:
        _write_polygons(polygons, split)
        say(f"polygons: {polygons}")
    if picture is not None:
        from fogwatch.pictures.maps import region_picture  # here: its library is an extra

        region_picture(terrain, widest, split, picture)
        say(f"picture: {picture}")


@command(app, examples=["fogwatch map extract site.mcap --out maps"])
def extract(
    bag: Annotated[Path, argument("BAG", "Bag of ROS 2: an .mcap or .db3 file, or a folder of such files.")],
    out: Annotated[Path, option("DIR", "Folder to write the map into, under the bag's name.")],
    topic: Annotated[str | None, option("TOPIC", "Topic of the grid (default: the only one).")] = None,
) -> None:
    """Write the newest OccupancyGrid of a bag as a map file and its image."""
    from fogwatch.grounds.bags import extract_map  # here: its libraries are extras

    path, grid = extract_map(bag, out, topic)
    height, width = grid.cells.shape
    say(f"{path}: {width} x {height} cells of {grid.resolution:.6g} m, of frame {grid.frame}")


def _region_lines(terrain: Terrain, radius: float, split: RegionSplit, took: float, by_hand: bool) -> Iterator[str]:
    """Yield lines of text that describe a split of the ground into regions.

    `radius` is that of the body, m, and `took` the time of the split, s. `by_hand` says that the scenario gave the
    regions.
    """
    xmin, ymin, xmax, ymax = terrain.bounds
    size = f"{xmax - xmin:g} x {ymax - ymin:g} m, points of {terrain.point:g} m"
    yield f"{terrain.name}: {size}; body radius {radius:g} m"
    count = len(split.polygons)
    areas = np.bincount(split.labels[split.labels >= 0], minlength=count) * terrain.point_area
    entered = np.unique(split.labels[split.parts >= 0]).size
    how = f"region{'' if count == 1 else 's'} {'given' if by_hand else 'found'}"
    yield f"regions: {count} convex {how} in {took:.2f} s; the body fits into {entered}"
    if count:
        smallest, middle, largest = areas.min(), float(np.median(areas)), areas.max()
        yield f"areas: {smallest:.1f} to {largest:.1f} m², median {middle:.1f} m²"
    yield f"connections: {len(split.connections)}"
    shown = np.argsort(-areas, kind="stable")[:MOST_LINES]
    for number in map(int, shown):
        x, y = (float(np.mean(values)) for values in zip(*split.polygons[number], strict=True))
        beside = {side for link in split.connections if number in link.regions for side in link.regions} - {number}
        names = ", ".join(map(str, sorted(beside))) or "none"
        yield f"  {number}: {areas[number]:.1f} m² around ({x:.2f}, {y:.2f}), connected to {names}"
    if count > MOST_LINES:
        yield f"  and {count - MOST_LINES} smaller ones"


def _write_polygons(out: Path, split: RegionSplit) -> None:
    """Write the polygons as YAML for a scenario file, to the millimetre."""
    corners = [", ".join(f"[{x:.3f}, {y:.3f}]" for x, y in polygon) for polygon in split.polygons]
    begin = ["patrol:", "  policy: potential-field", "  options:", "    paths: regions", "    regions: # m"]
    lines = [*begin, *(f"      - [{corner}]" for corner in corners), ""]
    with writing(out):
        out.write_text("\n".join(lines), encoding="utf-8")
