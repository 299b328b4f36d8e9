"""Checks of a scenario's closures against its other sections and its ground."""

from __future__ import annotations

from typing import TYPE_CHECKING

from patrol.closures.ground import with_closed
from patrol.closures.spec import closure_points
from patrol.errors import BadInput
from patrol.pose import Pose
from patrol.values import wrong
from patrol.zones.spec import check_names, check_ticks

if TYPE_CHECKING:
    from patrol.prepare import Prepared
    from patrol.scenario.model import Scenario


def check_closures(scenario: Scenario) -> None:
    """Refuse closures that do not fit the rest of a scenario."""
    check_names([closure.name for closure in scenario.closures], "closure")
    if not scenario.closures:
        return
    if scenario.patrol.paths != "wave":
        limit = f"{scenario.patrol.paths} knows the map and no closures; set it to wave, or drop closures"
        raise wrong("patrol.options.paths", limit)
    for number, closure in enumerate(scenario.closures):
        check_ticks(closure.closed or (), scenario.step, f"closures.{number}.closed", closure.name)


def check_closures_on_ground(prepared: Prepared) -> None:
    """Refuse closures that close nothing, or lie on starts or docks."""
    from patrol.ground.swept_path import free_fraction  # here: it loads kernels, and few scenarios have closures

    scenario, terrain = prepared.scenario, prepared.terrain
    for number, closure in enumerate(scenario.closures):
        where = f"closures.{number}.polygon: {closure.name}"
        if not closure_points(closure, terrain).size:
            raise BadInput(f"{where} holds no passable ground of {terrain.name}, which {terrain.span}; move or drop it")
        ground = with_closed(terrain, [closure])
        for spec, start in zip(scenario.roster, prepared.starts, strict=True):
            if free_fraction(ground, start, start, spec.radius) < 1.0:
                coordinates = f"({start.x:g}, {start.y:g})"
                raise BadInput(
                    f"{where} lies on the start of {spec.name} at {coordinates}; move it, or give robots.starts"
                )
        for index, dock in enumerate(scenario.docks):
            pose = Pose(*dock.place, 0.0)
            widest = max(spec.radius for spec in scenario.roster if spec.battery is not None)
            if free_fraction(ground, pose, pose, widest) < 1.0:
                raise BadInput(f"{where} lies on docks.{index}; move one of them")
