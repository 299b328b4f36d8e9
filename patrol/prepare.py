"""Everything about a scenario that never changes while it runs: the terrain, the starts, each body's static fields.

`prepare` finds the ground. What robots follow on it, rounds and the weights of zones, takes seconds to find and is of
use to those that run minds only, so it is a step of its own: `patrol.measures.zoned.with_rounds`.

The launcher prepares once and saves; its children load the same arrays memory-mapped, so a fleet holds one copy.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from patrol.changing.ground import ChangingFootprint, Closings, Parts
from patrol.changing.open_ground import OpenGround
from patrol.closures.checks import check_closures_on_ground
from patrol.closures.spec import closure_points
from patrol.energy.checks import check_docks_on_ground
from patrol.errors import BadInput, NotPrepared
from patrol.graph import check_vertices, graph_from_ground, graph_of, watching_vertices
from patrol.ground.cspace import check_areas
from patrol.ground.fields import StaticFields, compute_fields, load_grid, save_grids
from patrol.ground.footprint import REMEMBERED, Footprint
from patrol.ground.left_out import LeftOut, left_out
from patrol.ground.terrain import BoolGrid, Terrain, frozen_grid
from patrol.own_sensor import make_footprint
from patrol.pose import Pose
from patrol.scenario.sections import VERTICES
from patrol.tours.round import Round
from patrol.zones.checks import check_zones_on_ground
from patrol.zones.ground import with_zones

if TYPE_CHECKING:
    from patrol.graph import Graph
    from patrol.journal.records import Event
    from patrol.radio.inbox import Inboxes
    from patrol.regions.split import RegionSplit
    from patrol.scenario import Scenario

__all__ = ["Prepared", "prepare", "sensor_footprint"]

TICKS_APART = 4
"""Most ticks between two robots of a fleet where the world waits for none of them."""

FACTS = "prepared.json"
GROUND = ("passable", "keep_out", "free", "blocked")
BY_ROBOT = ("fields", "regions", "rounds")
"""What is kept for each robot; robots may share it."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """A scenario with its terrain, the robots' starts and the static fields of each robot's body.

    Robots of one radius share one StaticFields object, and one RegionSplit where paths lead through regions.
    """

    scenario: Scenario
    terrain: Terrain
    starts: tuple[Pose, ...]  # in roster order
    fields: Mapping[int, StaticFields]  # by robot number
    closable: Parts  # the parts of the ground that close at times
    regions: Mapping[int, RegionSplit] = field(default_factory=dict)  # by number; none where paths lead through none
    # by robot number, without zones; none before `patrol.measures.zoned.with_rounds`
    rounds: Mapping[int, Round | None] = field(default_factory=dict)
    # by name of the zones that weigh, as at first; empty before the same, and without any
    zone_weights: Mapping[str, float] = field(default_factory=dict)

    def open_ground(self) -> OpenGround:
        """Begin to follow the ground that is open to view."""
        radii, sensor = {spec.number: spec.radius for spec in self.scenario.roster}, self.scenario.sensor
        return OpenGround(self.terrain, self.patrolled, radii, sensor.range, sensor.line_of_sight)

    def closings(self, events: Iterable[Event] = ()) -> Closings:
        """Begin to follow what is closed, with the events so far."""
        return Closings(self.closable, self.terrain, events)

    @property
    def patrolled(self) -> BoolGrid:
        """bool (height, width), read-only: points that some robot of the fleet can see; what MFoW counts."""
        distinct = list({id(fields): fields.patrolled for fields in self.fields.values()}.values())
        return distinct[0] if len(distinct) == 1 else frozen_grid(np.logical_or.reduce(distinct))

    def find_left_out(self) -> LeftOut | None:
        """Find the free ground that no robot sees; None without any, and where vertices are patrolled instead."""
        if self.scenario.terrain.patrolled == VERTICES:
            return None
        narrowest = min(self.scenario.roster, key=lambda spec: (spec.radius, spec.number))
        return left_out(self.terrain, self.patrolled, self.fields[narrowest.number], narrowest.radius)

    def make_graph(self) -> Graph:
        """Make the terrain's graph: the scenario's, or one from the ground of the smallest robots, which takes long."""
        graph_spec = self.scenario.terrain.graph
        if graph_spec is not None:
            return graph_of(graph_spec.vertices, graph_spec.edges, graph_spec.pixel, graph_spec.visit)
        smallest = min(self.scenario.roster, key=lambda spec: (spec.radius, spec.number))
        return graph_from_ground(
            self.terrain, self.fields[smallest.number], sensor_footprint(self.scenario, self.terrain)
        )

    def as_operated(self, events: Iterable[Event]) -> Prepared:
        """Return the scenario with the operators' requests, which changes neither terrain nor robots."""
        from patrol.scenario.controls import operated  # here: an agent needs no controls

        scenario = operated(self.scenario, events)
        return self if scenario is self.scenario else replace(self, scenario=scenario)

    def save(self, folder: Path) -> None:
        """Write the arrays as .npy files and the rest as JSON."""
        save_grids(folder, self.terrain, GROUND)
        facts = {
            "name": self.terrain.name,
            "point": self.terrain.point,
            "origin": list(self.terrain.origin),
            "starts": [[start.x, start.y, start.heading] for start in self.starts],
            "zone_weights": dict(self.zone_weights),
        }
        for name in BY_ROBOT:
            parts: Mapping[int, Any] = getattr(self, name)
            folders: dict[int, str] = {}
            for part in parts.values():
                if part is not None and id(part) not in folders:
                    folders[id(part)] = f"{name}-{len(folders) + 1}"
                    part.save(folder / folders[id(part)])
            facts[name] = {str(number): folders.get(id(part)) for number, part in parts.items()}
        (folder / FACTS).write_text(json.dumps(facts, indent=1), encoding="utf-8")

    @staticmethod
    def load(scenario: Scenario, folder: Path) -> Prepared:
        """Load the fields that `save` wrote for a scenario; the arrays are memory-mapped and read-only."""
        facts = json.loads((folder / FACTS).read_text(encoding="utf-8"))
        x, y = facts["origin"]
        passable, keep_out, free, blocked = (load_grid(folder / f"{name}.npy") for name in GROUND)
        terrain = Terrain(facts["name"], passable, facts["point"], (x, y), keep_out)
        terrain = terrain.with_grids(free, blocked)
        loads: dict[str, Callable[[Path], Any]] = {"fields": StaticFields.load, "rounds": Round.load}
        if facts["regions"]:
            from patrol.regions.split import RegionSplit

            loads["regions"] = RegionSplit.load
        by_robot: dict[str, dict[int, Any]] = {}
        for name, load in loads.items():
            parts = {part: load(folder / part) for part in sorted({*facts[name].values()} - {None})}
            by_robot[name] = {int(number): parts.get(part) for number, part in facts[name].items()}
        return Prepared(
            scenario=scenario,
            terrain=terrain,
            starts=tuple(Pose(*start) for start in facts["starts"]),
            closable=closable_ground(scenario, terrain),
            zone_weights=facts["zone_weights"],
            **by_robot,
        )


def prepare(scenario: Scenario, terrain: Terrain | None = None) -> Prepared:
    """Load the terrain, place the robots and compute each body's fields; `NotPrepared` where these do not fit."""
    try:
        return _prepare_fields(scenario, terrain)
    except BadInput as error:
        raise NotPrepared(str(error)) from None


def terrain_of(scenario: Scenario, within: Path | None = None) -> Terrain:
    """Load a scenario's terrain; a map's files must lie in `within`, where None allows any place."""
    from patrol.maps.load import load_terrain  # here: loading a prepared scenario does not need it

    return with_zones(load_terrain(scenario.terrain, scenario.point, scenario.base, within), scenario.zones)


def _prepare_fields(scenario: Scenario, terrain: Terrain | None) -> Prepared:
    from patrol.starts import starts_of  # here: loading a prepared scenario does not need it

    if terrain is None:
        terrain = terrain_of(scenario)
    for number, intruder in enumerate(scenario.intruders):
        intruder.check_place(terrain, f"intruders.{number}.place")
    check_areas(scenario.patrol.critical_areas or (), terrain, "patrol.options.critical_areas")
    vertices = () if scenario.terrain.graph is None else scenario.terrain.graph.vertices
    check_vertices(vertices, terrain)
    closable = closable_ground(scenario, terrain)
    starts = starts_of(scenario.roster, scenario.seed, terrain, closable)
    by_radius: dict[float, StaticFields] = {}
    for radius in sorted({spec.radius for spec in scenario.roster}):
        group_starts = [start for spec, start in zip(scenario.roster, starts, strict=True) if spec.radius == radius]
        sensor = scenario.sensor
        by_radius[radius] = compute_fields(terrain, radius, sensor.range, sensor.line_of_sight, group_starts)
    if scenario.terrain.patrolled == VERTICES:
        by_radius = watching_vertices(vertices, terrain, by_radius)
    fields = {spec.number: by_radius[spec.radius] for spec in scenario.roster}
    prepared = Prepared(scenario, terrain, starts, fields, closable)
    check_docks_on_ground(scenario.docks, terrain, scenario.roster, starts, fields)
    check_zones_on_ground(scenario.zones, terrain, by_radius.values())
    check_closures_on_ground(closable, terrain, scenario.roster, starts, scenario.docks)
    if scenario.patrol.paths != "regions":
        return prepared
    from patrol.regions.split import split_for_bodies  # here: most robots need none

    splits = split_for_bodies(terrain, scenario.patrol.regions, by_radius)
    return replace(prepared, regions={spec.number: splits[spec.radius] for spec in scenario.roster})


def closable_ground(scenario: Scenario, terrain: Terrain) -> Parts:
    """Return the points of each part of the ground that closes at times, by its name."""
    return {closure.name: closure_points(closure, terrain) for closure in scenario.closures}


def sensor_footprint(scenario: Scenario, terrain: Terrain) -> Footprint:
    """Make the footprint of a scenario's sensor; a `ChangingFootprint` on ground that closes at times."""
    remembered = max(REMEMBERED, 2 * len(scenario.roster))
    if scenario.changes_ground:
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
    from patrol.radio.inbox import Inboxes, Rules  # here: it loads kernels, which a launcher compiles first

    fastest = max(spec.speed for spec in scenario.roster)
    ahead = (0 if scenario.factor is None else TICKS_APART) if knows_ticks else None
    return Inboxes(
        listeners, Rules(scenario.numbers, bounds, fastest, key, scenario.step, ahead, scenario.radio.trail_every)
    )
