"""Checks of a scenario's zones against its other sections and its ground."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from patrol.errors import BadInput
from patrol.faults.roster import tick_of
from patrol.ground.cspace import grown, parts_of
from patrol.ground.ways import unit
from patrol.values import wrong
from patrol.zones.ground import points_of
from patrol.zones.spec import check_names, check_ticks

if TYPE_CHECKING:
    from collections.abc import Mapping

    from patrol.ground.fields import StaticFields
    from patrol.ground.terrain import BoolGrid, Terrain
    from patrol.scenario.checked import CheckedGround, CheckedScenario
    from patrol.zones.spec import ZoneSpec

LEAST_LONG = 2.0
"""Length of a one-way zone at least where a robot gets, in its diameters and steps, besides a point's diagonal."""


def check_zones(scenario: CheckedScenario) -> None:
    """Refuse zones that do nothing in a scenario, whatever its ground, or do not fit the rest of it."""
    fastest = max(spec.speed for spec in scenario.roster)
    for number, zone in enumerate(scenario.zones):
        if zone.speed is not None and zone.speed >= fastest:
            limit = f"{zone.name} slows no robot, as the fastest drives {fastest:g} m/s; give less, or drop it"
            raise wrong(f"zones.{number}.speed", limit, zone.speed)
        check_ticks(zone.times or (), scenario.step, f"zones.{number}.times", zone.name)
        _check_weights(f"zones.{number}.weights", zone, scenario)
        if zone.one_way is not None:
            _check_direction(f"zones.{number}.one_way", zone.one_way, scenario)
    check_names([zone.name for zone in scenario.zones], "zone")


def _check_weights(field: str, zone: ZoneSpec, scenario: CheckedScenario) -> None:
    """Refuse later weights that never hold."""
    ticks = [*(tick_of(start_s, scenario.step) for start_s, _ in zone.weights or ()), scenario.ticks]
    for (start_s, weight), (tick, after) in zip(zone.weights or (), pairwise(ticks), strict=True):
        if tick >= after:
            ends = "the run ends" if after == scenario.ticks else "the next one holds"
            limit = f"{zone.name} is to count {weight:g} times from {start_s:g} s on, and by then {ends}; correct it"
            raise wrong(field, limit)


def _check_direction(field: str, degrees: int, scenario: CheckedScenario) -> None:
    """Refuse a one-way zone where something counts on ways that are as long there as back."""
    if scenario.patrol.sums_forces:
        sums = f"{scenario.patrol.policy} sums forces over ways that may lead against it"
        limit = f"{sums}; drop it, or choose another policy"
        raise wrong(field, limit, degrees)
    if scenario.closures:
        limit = "with closures, robots could not tell which ground no way leads back from; drop it, or them"
        raise wrong(field, limit, degrees)


def check_zones_on_ground(prepared: CheckedGround) -> None:
    """Refuse zones in which nothing is patrolled, slowed or directed."""
    scenario, terrain = prepared.scenario, prepared.terrain
    by_radius = dict(sorted({spec.radius: prepared.fields[spec.number] for spec in scenario.roster}.items()))
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
    scenario: CheckedScenario,
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
