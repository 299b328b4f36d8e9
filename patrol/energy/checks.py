"""Checks of a scenario's docks against its batteries and its ground."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Protocol

from patrol.energy.spec import JOULES
from patrol.errors import BadInput
from patrol.robot import RosterRobot
from patrol.values import wrong

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from patrol.energy.spec import BatterySpec, DockSpec
    from patrol.ground.fields import StaticFields
    from patrol.ground.terrain import Terrain
    from patrol.pose import Pose


class ChargedRobot(RosterRobot, Protocol):
    """A robot that may have a battery."""

    @property
    def battery(self) -> BatterySpec | None:
        """None for one that never gets empty."""
        ...


def check_docks(docks: Sequence[DockSpec], roster: Sequence[ChargedRobot]) -> None:
    """Refuse docks where nothing charges."""
    if docks and all(spec.battery is None for spec in roster):
        raise wrong("docks", "no robot has a battery, so none ever charges; give robots.battery, or drop docks")


def check_docks_on_ground(
    docks: Sequence[DockSpec],
    terrain: Terrain,
    roster: Sequence[ChargedRobot],
    starts: Sequence[Pose],
    fields: Mapping[int, StaticFields],
) -> None:
    """Refuse docks that no robot gets to, and robots that get to none; `fields` are by the robot's number."""
    charged = [spec for spec in roster if spec.battery is not None]
    served: set[int] = set()
    for number, dock in enumerate(docks):
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
        for earlier, earlier_dock in enumerate(docks[:number]):
            if (apart := math.dist(dock.place, earlier_dock.place)) < dock.radius + earlier_dock.radius:
                raise BadInput(
                    f"{where}: {apart:g} m from docks.{earlier}, so one robot would stand at both; "
                    "move it, or give both smaller radii"
                )
        served |= serves
    for spec, start in zip(roster, starts, strict=True):
        battery = spec.battery
        if battery is None or not docks:
            continue
        if spec.number not in served:
            raise BadInput(f"docks: {spec.name} gets to none of them; add one in its part of {terrain.name}")
        away_m = min(max(0.0, math.dist(dock.place, (start.x, start.y)) - dock.radius) for dock in docks)
        needed_wh = away_m * (battery.drive + battery.idle / spec.speed) / JOULES
        if needed_wh > battery.start * battery.capacity:
            raise BadInput(
                f"robots.battery.capacity = {battery.capacity:g}: {spec.name} starts with "
                f"{battery.start * battery.capacity:g} Wh, and the nearest dock is {away_m:.1f} m away, which needs "
                f"{needed_wh:.2g} Wh; give it more, or add a dock"
            )
