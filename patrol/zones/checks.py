"""Checks of a scenario's zones against its other sections and its ground."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

from patrol.areas import check_names, check_ticks
from patrol.errors import BadInput
from patrol.faults.roster import tick_of
from patrol.values import wrong
from patrol.zones.spec import points_of

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from patrol.ground.fields import StaticFields
    from patrol.ground.terrain import Terrain
    from patrol.robot import RosterRobot
    from patrol.zones.spec import ZoneSpec


def check_zones(zones: Sequence[ZoneSpec], roster: Sequence[RosterRobot], step: float, ticks: int) -> None:
    """Refuse zones that do nothing in a scenario, whatever its ground, or do not fit the rest of it."""
    fastest = max(spec.speed for spec in roster)
    for number, zone in enumerate(zones):
        if zone.speed is not None and zone.speed >= fastest:
            limit = f"{zone.name} slows no robot, as the fastest drives {fastest:g} m/s; give less, or drop it"
            raise wrong(f"zones.{number}.speed", limit, zone.speed)
        check_ticks(zone.times or (), step, f"zones.{number}.times", zone.name)
        _check_weights(f"zones.{number}.weights", zone, step, ticks)
    check_names([zone.name for zone in zones], "zone")


def _check_weights(field: str, zone: ZoneSpec, step: float, run_ticks: int) -> None:
    """Refuse later weights that never hold."""
    ticks = [*(tick_of(start_s, step) for start_s, _ in zone.weights or ()), run_ticks]
    for (start_s, weight), (tick, after) in zip(zone.weights or (), pairwise(ticks), strict=True):
        if tick >= after:
            ends = "the run ends" if after == run_ticks else "the next one holds"
            limit = f"{zone.name} is to count {weight:g} times from {start_s:g} s on, and by then {ends}; correct it"
            raise wrong(field, limit)


def check_zones_on_ground(zones: Sequence[ZoneSpec], terrain: Terrain, bodies: Collection[StaticFields]) -> None:
    """Refuse zones in which nothing is patrolled or slowed."""
    for number, zone in enumerate(zones):
        if zone.keep_out is None:
            points = points_of(zone, terrain)
            if zone.weighs and not any((fields.patrolled & points).any() for fields in bodies):
                why = "no robot sees any of it from ground that it can reach; correct or drop it"
                raise BadInput(f"zones.{number}: {zone.name}: {why}")
            if zone.speed is not None and not any((fields.reach & points).any() for fields in bodies):
                why = "no robot gets there, so it slows none; correct or drop it"
                raise BadInput(f"zones.{number}: {zone.name}: {why}")
