"""Everything about a scenario that never changes while it runs: the terrain, the starts, each body's static fields.

The launcher prepares once and saves; its children load the same arrays memory-mapped, so a fleet holds one copy.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from patrol.closures import closure_points
from patrol.errors import BadInput, NotPrepared
from patrol.ground.closed import ChangingFootprint
from patrol.ground.cspace import grown, parts_of
from patrol.ground.fields import StaticFields, compute_fields, load_grid
from patrol.ground.footprint import REMEMBERED, Footprint
from patrol.ground.left_out import LeftOut, left_out
from patrol.ground.one_way import unit
from patrol.ground.terrain import BoolGrid, Terrain, frozen_grid
from patrol.ground.zones import points_of, steps_against
from patrol.own_sensor import make_footprint
from patrol.pose import Pose
from patrol.radio.inbox import Inboxes, Rules
from patrol.scenario.sections import JOULES, VERTICES
from patrol.tours.round import Round
from patrol.tours.zoned import ZonedGround

if TYPE_CHECKING:
    from patrol.graph import Graph
    from patrol.journal.records import Event
    from patrol.regions.split import RegionSplit
    from patrol.scenario import ClosureSpec, IntruderSpec, Scenario
    from patrol.scenario.zones import Weighing

__all__ = ["Prepared", "prepare", "sensor_footprint"]

TICKS_APART = 4
"""Most ticks between two robots of a fleet where the world waits for none of them."""

LEAST_LONG = 2.0
"""Length of a one-way zone at least where a robot gets, in its diameters and steps, besides a point's diagonal."""

FACTS = "prepared.json"
GROUND = ("passable", "keep_out", "free", "blocked")
REGIONS = "regions"
ZONED = "zoned"


@dataclass(frozen=True, eq=False)
class Prepared:
    """A scenario with its terrain, the robots' starts and the static fields of each robot's body.

    Robots of one radius share one StaticFields object, and one RegionSplit where paths lead through regions.
    """

    scenario: Scenario
    terrain: Terrain
    starts: tuple[Pose, ...]  # in roster order
    fields: Mapping[int, StaticFields]  # by robot number
    regions: Mapping[int, RegionSplit] | None = None  # by robot number; None where paths do not lead through regions
    # by robot number, made on demand by `patrol.measures.best_tour.round_of`
    rounds: dict[int, Round | None] = field(default_factory=dict)
    # by zones in force and their weights, made on demand by `patrol.measures.zoned.zoned_ground`; bounded
    zoned: dict[Weighing, ZonedGround] = field(default_factory=dict)

    def regions_of(self, number: int) -> RegionSplit | None:
        """Return the split for a robot's body, or None where paths do not lead through regions."""
        return None if self.regions is None else self.regions[number]

    @cached_property
    def patrolled(self) -> BoolGrid:
        """bool (height, width), read-only: points that some robot of the fleet can see; what MFoW counts."""
        distinct = list({id(fields): fields for fields in self.fields.values()}.values())
        return frozen_grid(np.logical_or.reduce([fields.patrolled for fields in distinct]))

    @cached_property
    def left_out(self) -> LeftOut | None:
        """The free ground that no robot sees; None where there is none, and where vertices are patrolled instead."""
        if self.scenario.terrain.patrolled == VERTICES:
            return None
        narrowest = min(self.scenario.roster, key=lambda spec: (spec.radius, spec.number))
        return left_out(self.terrain, self.patrolled, self.fields[narrowest.number], narrowest.radius)

    @cached_property
    def graph(self) -> Graph:
        """The terrain's graph: the scenario's, or one that is made from the ground of the smallest robots."""
        from patrol.graph import graph_of
        from patrol.graph_from_ground import graph_from_ground  # here: few fleets need a graph

        given = self.scenario.terrain.graph
        if given is not None:
            return graph_of(given.vertices, given.edges, given.pixel, given.visit)
        least = min(self.scenario.roster, key=lambda spec: (spec.radius, spec.number))
        return graph_from_ground(self.terrain, self.fields[least.number], sensor_footprint(self.scenario, self.terrain))

    def as_operated(self, events: Iterable[Event]) -> Prepared:
        """Return the scenario with what operators have asked for, which changes neither terrain nor robots."""
        from patrol.scenario.controls import operated  # here: an agent needs no controls

        scenario = operated(self.scenario, events)
        return self if scenario is self.scenario else replace(self, scenario=scenario)

    def save(self, folder: Path) -> None:
        """Write the arrays as .npy files and the rest as JSON."""
        folder.mkdir(parents=True, exist_ok=True)
        for name in GROUND:
            np.save(folder / f"{name}.npy", getattr(self.terrain, name))
        places: dict[int, str] = {}
        for fields in self.fields.values():
            if id(fields) not in places:
                places[id(fields)] = f"body-{len(places) + 1}"
                fields.save(folder / places[id(fields)])
        for number, split in (self.regions or {}).items():
            split_folder = folder / places[id(self.fields[number])] / REGIONS
            if not split_folder.exists():
                split.save(split_folder)
        kept: dict[int, str] = {}
        for laid_out in self.rounds.values():
            if laid_out is not None and id(laid_out) not in kept:
                kept[id(laid_out)] = f"round-{len(kept) + 1}"
                laid_out.save(folder / kept[id(laid_out)])
        for number, zoned in enumerate(self.zoned.values()):
            zoned.save(folder / f"{ZONED}-{number}")
        facts = {
            "name": self.terrain.name,
            "point": self.terrain.point,
            "origin": list(self.terrain.origin),
            "starts": [[start.x, start.y, start.heading] for start in self.starts],
            "fields": {str(number): places[id(fields)] for number, fields in self.fields.items()},
            "rounds": {str(number): laid_out and kept[id(laid_out)] for number, laid_out in self.rounds.items()},
            "zoned": [sorted(weighing) for weighing in self.zoned],
        }
        (folder / FACTS).write_text(json.dumps(facts, indent=1), encoding="utf-8")

    @staticmethod
    def load(scenario: Scenario, folder: Path) -> Prepared:
        """Load what `save` wrote for a scenario; the arrays are memory-mapped and read-only."""
        facts = json.loads((folder / FACTS).read_text(encoding="utf-8"))
        x, y = facts["origin"]
        passable, keep_out, free, blocked = (load_grid(folder / f"{name}.npy") for name in GROUND)
        terrain = Terrain(facts["name"], passable, facts["point"], (x, y), keep_out)
        terrain = replace(terrain, against=steps_against(scenario.zones, terrain)).with_grids(free, blocked)
        bodies = {part: StaticFields.load(folder / part) for part in sorted(set(facts["fields"].values()))}
        kept = {part: Round.load(folder / part) for part in sorted({*facts["rounds"].values()} - {None})}
        return Prepared(
            scenario=scenario,
            terrain=terrain,
            starts=tuple(Pose(*start) for start in facts["starts"]),
            fields={int(number): bodies[part] for number, part in facts["fields"].items()},
            regions=_load_regions(scenario, folder, {int(number): part for number, part in facts["fields"].items()}),
            rounds={int(number): part and kept[part] for number, part in facts["rounds"].items()},
            zoned={
                frozenset((name, weight) for name, weight in weighing): ZonedGround.load(folder / f"{ZONED}-{number}")
                for number, weighing in enumerate(facts["zoned"])
            },
        )


def prepare(scenario: Scenario, terrain: Terrain | None = None) -> Prepared:
    """Load the terrain, place the robots and compute each body's fields; `NotPrepared` where these do not fit."""
    try:
        return _prepared(scenario, terrain)
    except BadInput as error:
        raise NotPrepared(str(error)) from None


def _prepared(scenario: Scenario, terrain: Terrain | None) -> Prepared:
    from patrol.maps.load import load_terrain  # here: loading a prepared scenario does not need it

    if terrain is None:
        terrain = load_terrain(scenario.terrain, scenario.point, scenario.base, zones=scenario.zones)
    for number, intruder in enumerate(scenario.intruders):
        check_intruder(intruder, terrain, f"intruders.{number}.place")
    _check_critical_areas(scenario, terrain)
    _check_graph(scenario, terrain)
    starts = _starts(scenario, terrain)
    by_radius: dict[float, StaticFields] = {}
    for radius in sorted({spec.radius for spec in scenario.roster}):
        own = [start for spec, start in zip(scenario.roster, starts, strict=True) if spec.radius == radius]
        sensor = scenario.sensor
        by_radius[radius] = compute_fields(terrain, radius, sensor.range, sensor.line_of_sight, own)
    if scenario.terrain.patrolled == VERTICES:
        by_radius = _watching_vertices(scenario, terrain, by_radius)
    fields = {spec.number: by_radius[spec.radius] for spec in scenario.roster}
    _check_docks(scenario, terrain, fields, starts)
    _check_zones(scenario, terrain, by_radius)
    _check_closures(scenario, terrain, starts)
    regions = None
    if scenario.patrol.paths == "regions":
        splits = _split(scenario, terrain, by_radius)
        regions = {spec.number: splits[spec.radius] for spec in scenario.roster}
    return Prepared(scenario, terrain, starts, fields, regions)


def _starts(scenario: Scenario, terrain: Terrain) -> tuple[Pose, ...]:
    """Place the robots, clear of all closures. Raises BadInput, which names the closures where they take the room."""
    from patrol.starts import place_starts  # here: loading a prepared scenario does not need it

    roster, seed, closures = scenario.roster, scenario.seed, scenario.closures
    if not closures:
        return tuple(place_starts(terrain, roster, seed))
    try:
        return tuple(place_starts(terrain, roster, seed, _with_closed(terrain, closures)))
    except BadInput:
        place_starts(terrain, roster, seed)  # raises the same where closures are not to blame
    number, largest = max(enumerate(closures), key=lambda each: closure_points(each[1], terrain).size)
    robots = sum(not spec.spare for spec in roster)
    fleet = f"{robots} {'robot' if robots == 1 else 'robots'}"
    room = f"no room on {terrain.name} for the starts of {fleet}, which are clear of closures"
    try:
        place_starts(terrain, roster, seed, _with_closed(terrain, [largest]))
    except BadInput:
        why = f"closures.{number}.polygon: {largest.name} leaves {room}; make it smaller, or start fewer robots"
    else:
        why = f"closures: together they leave {room}; make some smaller, or start fewer robots"
    raise BadInput(why)


def sensor_footprint(scenario: Scenario, terrain: Terrain) -> Footprint:
    """Make the footprint of a scenario's sensor; a `ChangingFootprint` on ground with closures."""
    remembered = max(REMEMBERED, 2 * len(scenario.roster))
    if scenario.closures:
        return ChangingFootprint(lambda ground: make_footprint(scenario.sensor, ground, remembered), terrain)
    return make_footprint(scenario.sensor, terrain, remembered)


def inboxes_of(
    scenario: Scenario,
    listeners: Sequence[int],
    bounds: tuple[float, float, float, float],
    key: bytes | None,
    *,
    knows_ticks: bool = True,
) -> Inboxes:
    """Make the inboxes of some of a scenario's robots; a listener with the number of no robot only listens.

    `bounds` are the terrain's (x_min, y_min, x_max, y_max) in m, and `key` is None when the fleet uses no tags. A fleet
    `knows_ticks` where its robots' clocks show the time since its first tick.
    """
    fastest = max(spec.speed for spec in scenario.roster)
    numbers = tuple(spec.number for spec in scenario.roster)
    ahead = (0 if scenario.factor is None else TICKS_APART) if knows_ticks else None
    return Inboxes(listeners, Rules(numbers, bounds, fastest, key, scenario.step, ahead, scenario.radio.trail_every))


def check_intruder(intruder: IntruderSpec, terrain: Terrain, field: str) -> None:
    """Refuse an intruder that does not stand on passable ground."""
    x, y = intruder.place
    where = f"{field} = [{x:g}, {y:g}]"
    if not terrain.contains(x, y):
        xmin, ymin, xmax, ymax = terrain.bounds
        span = f"spans x {xmin:g} to {xmax:g} m and y {ymin:g} to {ymax:g} m"
        raise BadInput(f"{where}: not on {terrain.name}, which {span}; move it there")
    if not terrain.passable[terrain.point_at(x, y)]:
        raise BadInput(f"{where}: in an obstacle of {terrain.name}; move it to passable ground")


def _check_docks(
    scenario: Scenario, terrain: Terrain, fields: Mapping[int, StaticFields], starts: Sequence[Pose]
) -> None:
    charged = [spec for spec in scenario.roster if spec.battery is not None]
    served: set[int] = set()
    for number, dock in enumerate(scenario.docks):
        where = f"docks.{number}.place = [{dock.place[0]:g}, {dock.place[1]:g}]"
        row, col = terrain.point_at(*dock.place)
        serves = {spec.number for spec in charged if terrain.inside(row, col) and fields[spec.number].reach[row, col]}
        if not serves:
            raise BadInput(f"{where}: no robot with a battery gets there on {terrain.name}; move it to open ground")
        if (away := math.dist(dock.place, terrain.centre(row, col))) > dock.radius:
            raise BadInput(
                f"docks.{number}.radius = {dock.radius:g}: robots stand at centres of points, and the nearest is "
                f"{away:.2f} m away; give more, or move the dock to a centre"
            )
        for earlier, other in enumerate(scenario.docks[:number]):
            if (apart := math.dist(dock.place, other.place)) < dock.radius + other.radius:
                raise BadInput(
                    f"{where}: {apart:g} m from docks.{earlier}, so one robot would stand at both; "
                    "move it, or give both smaller radii"
                )
        served |= serves
    for spec, start in zip(scenario.roster, starts, strict=True):
        battery = spec.battery
        if battery is None or not scenario.docks:
            continue
        if spec.number not in served:
            raise BadInput(f"docks: {spec.name} gets to none of them; add one in its part of {terrain.name}")
        away_m = min(max(0.0, math.dist(dock.place, (start.x, start.y)) - dock.radius) for dock in scenario.docks)
        needed_wh = away_m * (battery.drive + battery.idle / spec.speed) / JOULES
        if needed_wh > battery.start * battery.capacity:
            raise BadInput(
                f"robots.battery.capacity = {battery.capacity:g}: {spec.name} starts with "
                f"{battery.start * battery.capacity:g} Wh, and the nearest dock is {away_m:.1f} m away, which needs "
                f"{needed_wh:.2g} Wh; give it more, or add a dock"
            )


def _check_critical_areas(scenario: Scenario, terrain: Terrain) -> None:
    from patrol.ground.shapes import cover

    for number, polygon in enumerate(scenario.patrol.critical_areas or ()):
        if not (terrain.free & cover(polygon, terrain.shape, terrain.point, terrain.origin)).any():
            field = f"patrol.options.critical_areas.{number}"
            raise BadInput(f"{field}: holds no free point of {terrain.name}; correct or drop it")


def _check_zones(scenario: Scenario, terrain: Terrain, by_radius: Mapping[float, StaticFields]) -> None:
    for number, zone in enumerate(scenario.zones):
        if zone.keep_out is None:
            points, bodies = points_of(zone, terrain), by_radius.values()
            if zone.weighs and not any((fields.patrolled & points).any() for fields in bodies):
                why = "no robot sees any of it from ground that it can reach; correct or drop it"
                raise BadInput(f"zones.{number}: {zone.name}: {why}")
            if zone.speed is not None and not any((fields.reach & points).any() for fields in bodies):
                why = "no robot gets there, so it slows none; correct or drop it"
                raise BadInput(f"zones.{number}: {zone.name}: {why}")
            if zone.one_way is not None:
                _check_one_way(f"zones.{number}: {zone.name}", zone.one_way, points, scenario, terrain, by_radius)


def _check_one_way(
    where: str,
    degrees: int,
    points: BoolGrid,
    scenario: Scenario,
    terrain: Terrain,
    by_radius: Mapping[float, StaticFields],
) -> None:
    """Refuse a zone that bodies cross in a few steps, or none gets to: the verdict could not tell its direction.

    Only its points that bodies reach count, and of several parts of these, as on both sides of a wall, the longest.
    """
    bodies = [(radius, fields.reach) for radius, fields in by_radius.items() if (fields.reach & points).any()]
    if not bodies:
        raise BadInput(f"{where}: no robot gets there, so it directs none; correct or drop it")
    for radius, reach in bodies:
        longest_m = max(2.0 * radius + spec.speed * scenario.step for spec in scenario.roster if spec.radius == radius)
        least_m = LEAST_LONG * longest_m + math.sqrt(2.0) * terrain.point
        length_m = _longest_part_m(degrees, points, reach, terrain)
        if length_m < least_m:
            long = f"is {length_m:.2f} m long in its direction where robots of radius {radius:g} m get"
            remedy = "make it longer there"
            raise BadInput(f"{where}: {long}, and they take at least {least_m:.2f} m to show theirs; {remedy}")


def _longest_part_m(degrees: int, points: BoolGrid, reach: BoolGrid, terrain: Terrain) -> float:
    """Return the length, in a direction, of the longest part of a zone in which a body can go on; m."""
    # With the points around, a thin zone that goes up by corners stays in one part, as for the ways of bodies.
    labels, count = parts_of(reach & grown(points))
    rows, cols = np.nonzero(reach & points)
    across, up = unit(degrees)
    along = (cols * across + rows * up) * terrain.point
    first, last = np.full(count + 1, np.inf), np.full(count + 1, -np.inf)
    np.minimum.at(first, labels[rows, cols], along)
    np.maximum.at(last, labels[rows, cols], along)
    return float((last - first).max()) + terrain.point


def _check_closures(scenario: Scenario, terrain: Terrain, starts: Sequence[Pose]) -> None:
    from patrol.ground.swept_path import free_fraction  # here: it loads kernels, and few scenarios have closures

    for number, closure in enumerate(scenario.closures):
        where = f"closures.{number}.polygon: {closure.name}"
        if not closure_points(closure, terrain).size:
            xmin, ymin, xmax, ymax = terrain.bounds
            span = f"spans x {xmin:g} to {xmax:g} m and y {ymin:g} to {ymax:g} m"
            raise BadInput(f"{where} holds no passable ground of {terrain.name}, which {span}; move or drop it")
        ground = _with_closed(terrain, [closure])
        for spec, start in zip(scenario.roster, starts, strict=True):
            if free_fraction(ground, start, start, spec.radius) < 1.0:
                at = f"({start.x:g}, {start.y:g})"
                raise BadInput(f"{where} lies on the start of {spec.name} at {at}; move it, or give robots.starts")
        for place, dock in enumerate(scenario.docks):
            pose = Pose(*dock.place, 0.0)
            widest = max(spec.radius for spec in scenario.roster if spec.battery is not None)
            if free_fraction(ground, pose, pose, widest) < 1.0:
                raise BadInput(f"{where} lies on docks.{place}; move one of them")


def _with_closed(terrain: Terrain, closures: Sequence[ClosureSpec]) -> Terrain:
    """Return the ground with some closures closed."""
    passable = terrain.passable.copy()
    for closure in closures:
        passable.reshape(-1)[closure_points(closure, terrain)] = False
    return Terrain(terrain.name, passable, terrain.point, terrain.origin)


def _check_graph(scenario: Scenario, terrain: Terrain) -> None:
    for number, (x, y) in enumerate(scenario.terrain.graph.vertices if scenario.terrain.graph else ()):
        if not terrain.contains(x, y):
            where = f"terrain.graph: vertex {number} at [{x:g}, {y:g}]"
            raise BadInput(f"{where}: not on {terrain.name}; give the graph of this terrain")


def _watching_vertices(
    scenario: Scenario, terrain: Terrain, by_radius: Mapping[float, StaticFields]
) -> dict[float, StaticFields]:
    """Leave nothing patrolled but the points that hold the graph's vertices."""
    graph = scenario.terrain.graph
    at = [terrain.point_at(*place) for place in (() if graph is None else graph.vertices)]
    points = np.zeros(terrain.shape, dtype=np.bool_)
    points[tuple(np.transpose(at))] = True
    watching = {radius: fields.watching(points) for radius, fields in by_radius.items()}
    for number, point in enumerate(at):
        if not any(fields.patrolled[point] for fields in watching.values()):
            x, y = terrain.centre(*point)
            where = f"terrain.graph: vertex {number} near [{x:.4g}, {y:.4g}]"
            raise BadInput(
                f"{where}: no robot sees it from ground that it can reach; correct the vertex, start a robot in its "
                "part of the terrain, or set terrain.patrolled to ground"
            )
    for radius, fields in watching.items():
        if not fields.patrolled.any():
            raise BadInput(
                f"terrain.patrolled: robots of radius {radius:g} m see no vertex from ground that they can reach; "
                "start them elsewhere or leave them out"
            )
    return watching


def _split(scenario: Scenario, terrain: Terrain, by_radius: Mapping[float, StaticFields]) -> dict[float, RegionSplit]:
    """Make the regions, those given or automatic ones, and their connections for each radius."""
    from patrol.regions.split import regions_by_hand, split_regions  # here: most robots need none

    everywhere = np.logical_or.reduce([fields.reach for fields in by_radius.values()])
    polygons = scenario.patrol.regions
    split = split_regions(terrain, everywhere) if polygons is None else regions_by_hand(terrain, polygons, everywhere)
    return {radius: split.for_body(terrain, fields.reach) for radius, fields in by_radius.items()}


def _load_regions(scenario: Scenario, folder: Path, places: Mapping[int, str]) -> dict[int, RegionSplit] | None:
    """Load the saved splits by robot number; places: each robot's folder."""
    if scenario.patrol.paths != "regions":
        return None
    from patrol.regions.split import RegionSplit

    splits = {name: RegionSplit.load(folder / name / REGIONS) for name in sorted(set(places.values()))}
    return {number: splits[name] for number, name in places.items()}
