"""Checks of a scenario's zones against its other sections and its ground."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

from patrol.errors import BadInput
from patrol.faults.roster import tick_of
from patrol.values import wrong
from patrol.zones.ground import points_of
from patrol.zones.spec import check_names, check_ticks

if TYPE_CHECKING:
    from patrol.prepare import Prepared
    from patrol.scenario.model import Scenario
    from patrol.zones.spec import ZoneSpec


def check_zones(scenario: Scenario) -> None:
    """Refuse zones that do nothing in a scenario, whatever its ground, or do not fit the rest of it."""
    fastest = max(spec.speed for spec in scenario.roster)
    for number, zone in enumerate(scenario.zones):
        if zone.speed is not None and zone.speed >= fastest:
            limit = f"{zone.name} slows no robot, as the fastest drives {fastest:g} m/s; give less, or drop it"
            raise wrong(f"zones.{number}.speed", limit, zone.speed)
        check_ticks(zone.times or (), scenario.step, f"zones.{number}.times", zone.name)
        _check_weights(f"zones.{number}.weights", zone, scenario)
    check_names([zone.name for zone in scenario.zones], "zone")


def _check_weights(field: str, zone: ZoneSpec, scenario: Scenario) -> None:
    """Refuse later weights that never hold."""
    ticks = [*(tick_of(start_s, scenario.step) for start_s, _ in zone.weights or ()), scenario.ticks]
    for (start_s, weight), (tick, after) in zip(zone.weights or (), pairwise(ticks), strict=True):
        if tick >= after:
            ends = "the run ends" if after == scenario.ticks else "the next one holds"
            limit = f"{zone.name} is to count {weight:g} times from {start_s:g} s on, and by then {ends}; correct it"
            raise wrong(field, limit)


def check_zones_on_ground(prepared: Prepared) -> None:
    """Refuse zones in which nothing is patrolled or slowed."""
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
