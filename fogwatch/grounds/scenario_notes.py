"""Notes on a scenario that a reader must know before believing what is computed of it; zones and closures measured."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from patrol.changing.ground import ChangingTerrain, ClosedPoints
from patrol.ground.cspace import cspace_of, parts_of
from patrol.ground.fog import Fog
from patrol.journal.records import CLOSED, Event
from patrol.maps.doubts import doubts
from patrol.measures.best_tour import TourFinder, best_tour
from patrol.measures.zoned import zone_weights
from patrol.prepare import Prepared, sensor_footprint
from patrol.radio.message import as_received
from patrol.scenario.patrols import FIELD, PATROLS, STOCHASTIC, TOUR
from patrol.scenario.policies import StochasticPatrol
from patrol.scenario.sections import BUILT_IN_SENSORS
from patrol.zones.spec import points_of

if TYPE_CHECKING:
    from fogwatch.grounds.map_check import MapReport
    from patrol.ground.left_out import LeftOut
    from patrol.ground.terrain import BoolGrid, Terrain


def zone_lines(prepared: Prepared, before: MapReport, after: MapReport) -> Iterator[str]:
    """Yield the result of a check of zones as lines of text.

    `before` is the map check without keep-outs of zones, `after` the one with them.
    """
    zones = prepared.scenario.zones
    robots, sensor = len(prepared.scenario.roster), prepared.scenario.sensor
    body = prepared.scenario.roster[0]
    fleet = ""
    if any(zone.age is not None for zone in zones):
        fleet = (
            f"; wanted ages are weighed for {robots} {body.model} robots of radius {body.radius:g} m at {body.speed:g} "
            f"m/s that see {sensor.range:g} m, and otherwise in a run of another fleet"
        )
    yield f"zones: {len(zones)}{fleet}"
    weights = zone_weights(prepared)
    area = prepared.terrain.point_area
    for zone in zones:
        points = points_of(zone, prepared.terrain)
        if zone.keep_out:
            closed = np.count_nonzero(points & before.fields.reach) * area
            yield f"  {zone.name}: keep-out, {closed:.1f} m² of reachable ground"
            continue
        times = f"; in force {zone.when}" if zone.times else ""
        if zone.times == ():
            times = "; in force only once it is switched on"
        if zone.speed is not None:
            slow = np.count_nonzero(points & before.fields.reach) * area
            yield f"  {zone.name}: at most {zone.speed:g} m/s on {slow:.1f} m² of reachable ground{times}"
            continue
        seen_m2 = np.count_nonzero(points & prepared.patrolled) * area
        wish = "" if zone.age is None else f"; {_wish_text(zone.age, points, prepared)}"
        yield f"  {zone.name}: weight {weights[zone.name]:g}, {seen_m2:.1f} m² to patrol{wish}{times}"
    inside = [points_of(zone, prepared.terrain) for zone in zones if zone.keep_out]
    if inside:
        cut = before.fields.reach & ~after.fields.reach & ~np.logical_or.reduce(inside)
        cut_m2 = np.count_nonzero(cut) * area
        lost_m2 = np.count_nonzero(before.fields.patrolled & ~after.fields.patrolled) * area
        lost = f"{lost_m2:.1f} m² is no longer seen"
        yield f"  beside and behind keep-outs: {cut_m2:.1f} m² more cannot be reached, {lost}"


def _wish_text(age_s: float, points: BoolGrid, prepared: Prepared) -> str:
    """Say how much of the fleet it takes to keep the wanted age of a zone's points."""
    robots, wanted = prepared.scenario.team, f"wanted age {age_s:g} s"
    tour_s = best_tour(prepared, points).bound_of_fleet_s(prepared.scenario)
    if tour_s is None:
        return f"{wanted}: not judged, as there is no tour of this zone"
    needed = robots * tour_s / age_s
    takes = f"its tour takes at least {needed:.1f} of {robots} robots, without the way there"
    return f"{wanted}: {takes}" if needed <= robots else f"{wanted}: cannot be kept, as {takes}"


def closure_lines(prepared: Prepared) -> Iterator[str]:
    """Yield the result of a check of closures as lines of text."""
    scenario, area = prepared.scenario, prepared.terrain.point_area
    yield f"closures: {len(scenario.closures)}"
    starts = {spec.number: start for spec, start in zip(scenario.roster, prepared.starts, strict=True)}
    places = {number: (start.x, start.y) for number, start in starts.items()}
    for closure in scenario.closures:
        closed = ClosedPoints(prepared.closable, prepared.terrain)
        closed.take(Event(0, CLOSED, None, closure.name))
        ground = ChangingTerrain(prepared.terrain)
        ground.close(closed.grid)
        open_ground, from_one_side = prepared.open_ground(), prepared.open_ground()
        open_ground.tick(0, ground, closed.names, places, {})
        out = np.count_nonzero(open_ground.closed_out) * area
        from_one_side.tick(0, ground, closed.names, _largest_side(prepared, ground), {})
        behind = np.count_nonzero(from_one_side.closed_out) * area
        alone = [scenario.roster[number - 1].name for number in open_ground.shut_in()]
        shut_in = f"; shuts in {', '.join(alone)} at the start" if alone else ""
        points = len(closed.points[closure.name])
        sides = ", as robots start on both sides" if out < behind else ""
        yield (
            f"  {closure.name}: {points * area:.1f} m², {behind:.1f} m² behind it; closes out {out:.1f} m² from the "
            f"starts{sides}{shut_in}"
        )


def _largest_side(prepared: Prepared, ground: Terrain) -> dict[int, tuple[float, float]]:
    """Return a place for robot 1 in the largest part of the ground that is left; nothing if it fits nowhere."""
    spec = prepared.scenario.roster[0]
    labels = parts_of(cspace_of(ground, spec.radius) & prepared.fields[spec.number].reach)[0]
    sizes = np.bincount(labels.reshape(-1))
    sizes[0] = 0
    if not sizes.any():
        return {}
    row, col = divmod(int(np.argmax(labels.reshape(-1) == sizes.argmax())), ground.width)
    return {spec.number: ground.centre(row, col)}


MEASURED = "docs/results/intruders.md#where-nothing-is-drawn"


def scenario_notes(prepared: Prepared) -> list[str]:
    """Describe in a line each what is doubtful about a scenario.

    That is: doubtful readings of the map, free ground that no robot sees, nothing to patrol, a patrol without a plan,
    older settings.
    """
    left_out = prepared.find_left_out()
    return [
        *doubts(prepared.terrain),
        *([] if left_out is None else [f"left out: {left_out.text}{_start_there(left_out)}"]),
        *_in_sight(prepared),
        *_not_drawn(prepared),
    ]


def _in_sight(prepared: Prepared) -> list[str]:
    """Say that the robots see all ground from their starts, which leaves them nothing to do."""
    scenario, sensor = prepared.scenario, prepared.scenario.sensor
    if sensor.kind not in BUILT_IN_SENSORS or sensor.quality != 1.0 or scenario.changes_ground:
        return []
    fog, footprint = Fog(prepared.patrolled), sensor_footprint(scenario, prepared.terrain)
    for spec, start in zip(scenario.roster, prepared.starts, strict=True):
        if not spec.spare:
            fog.observe(footprint.visible(as_received(start)), 0)
    if fog.seen < np.count_nonzero(prepared.patrolled):
        return []
    sees = f"sensor.range = {sensor.range:g} m{', the default' if 'sensor.range' in scenario.assumed else ''}"
    remedy = "so no robot has to move; give --sensor-range if it is less"
    return [f"all ground is in sight from the starts ({sees}), {remedy}"]


def _start_there(left_out: LeftOut) -> str:
    """Return the remedy for ground that a robot could patrol if it started there; empty where its body does not fit."""
    if left_out.why.startswith("too narrow"):
        return ""
    return f"; to patrol it too, start a robot there, as with --start {left_out.x:.2f},{left_out.y:.2f}"


def _not_drawn(prepared: Prepared) -> list[str]:
    """Say that the patrols `stochastic` and `tour` have no plan, or that nothing is drawn from it, and why."""
    scenario = prepared.scenario
    policy = scenario.patrol.policy
    if policy not in (PATROLS[STOCHASTIC].policy, PATROLS[TOUR].policy):
        return []
    free = f"{FIELD} {policy}: each robot chooses its next place freely, without a plan"
    if why := "doors may close" if scenario.changes_ground else TourFinder(prepared).why_no_rounds:
        return [f"{free}: {why}"]
    if isinstance(scenario.patrol, StochasticPatrol) and scenario.patrol.options.unpredictability == 0.0:
        return [f"patrol.options.unpredictability = 0: the best plan is followed, and nothing is drawn ({MEASURED})"]
    return []
