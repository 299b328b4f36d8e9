"""Zone check: the areas and times of zones, what keep-outs shut off, and which wanted ages a fleet can keep."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from patrol.ground.zones import points_of
from patrol.measures.best_tour import MOST_ROBOTS
from patrol.measures.zoned import zone_weights, zoned_ground

if TYPE_CHECKING:
    from fogwatch.grounds.map_check import MapReport
    from patrol.ground.tour.zoned import ZonedGround
    from patrol.prepare import Prepared
    from patrol.scenario import ZoneSpec


def zone_lines(prepared: Prepared, before: MapReport, after: MapReport) -> Iterator[str]:
    """Yield the result of a check of zones as lines of text.

    `before` is the map check without keep-outs of zones, `after` the one with them.
    """
    zones = prepared.scenario.zones
    yield f"zones: {len(zones)}"
    weights, zoned = zone_weights(prepared), zoned_ground(prepared)
    robots = len(prepared.scenario.roster)
    area = prepared.terrain.point_area
    for zone in zones:
        points = points_of(zone, prepared.terrain)
        if zone.keep_out:
            closed = np.count_nonzero(points & before.fields.reach) * area
            yield f"  {zone.name}: keep-out, {closed:.1f} m² of reachable ground"
            continue
        if zone.one_way is not None:
            directed = np.count_nonzero(points & after.fields.reach) * area
            niches = np.count_nonzero(points & after.fields.cspace & ~after.fields.reach) * area
            left_out = f"; {niches:.1f} m² in niches left out, as no way leads there and back" if niches else ""
            yield f"  {zone.label}: one way at {zone.one_way} degrees, {directed:.1f} m² of reachable ground{left_out}"
            continue
        times = f"; in force {zone.when}" if zone.times else ""
        if zone.times == ():
            times = "; in force only once it is switched on"
        if zone.speed is not None:
            slow = np.count_nonzero(points & before.fields.reach) * area
            yield f"  {zone.name}: at most {zone.speed:g} m/s on {slow:.1f} m² of reachable ground{times}"
            continue
        seen = np.count_nonzero(points & prepared.patrolled) * area
        wish = "" if zoned is None or zone.age is None else f"; {_wish(zone, zoned, prepared, robots)}"
        yield f"  {zone.name}: weight {weights[zone.name]:g}, {seen:.1f} m² to patrol{wish}{times}"
    inside = [points_of(zone, prepared.terrain) for zone in zones if zone.keep_out]
    if inside:
        cut = before.fields.reach & ~after.fields.reach & ~np.logical_or.reduce(inside)
        cut_m2 = np.count_nonzero(cut) * area
        lost_m2 = np.count_nonzero(before.fields.patrolled & ~after.fields.patrolled) * area
        lost = f"{lost_m2:.1f} m² is no longer seen"
        yield f"  beside and behind keep-outs: {cut_m2:.1f} m² more cannot be reached, {lost}"


def _wish(zone: ZoneSpec, zoned: ZonedGround, prepared: Prepared, robots: int) -> str:
    """Say whether robots can keep a zone's wanted age on the rounds of the best division, or else how many could."""
    at = f"wanted age {zone.age:g} s"
    if not zoned.rounds:
        return f"{at}: not judged, as there are no rounds over these zones"
    points = points_of(zone, prepared.terrain) & prepared.patrolled
    number = zoned.classes.index(float(zoned.weights[points].min()))
    if zoned.wish_kept(zoned.divide(robots), number):
        return f"{at}: {robots} robots can keep it"
    enough = [n for n in range(robots + 1, MOST_ROBOTS + 1) if zoned.wish_kept(zoned.divide(n), number)]
    remedy = f"{enough[0]} robots could" if enough else f"nor could {MOST_ROBOTS}"
    return f"{at}: cannot be kept by {robots} robots; {remedy}"
