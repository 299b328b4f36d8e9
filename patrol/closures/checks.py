"""Checks of a scenario's closures against its other sections and its ground."""

from __future__ import annotations

from typing import TYPE_CHECKING

from patrol.areas import check_names, check_ticks
from patrol.changing.ground import with_closed
from patrol.errors import BadInput
from patrol.pose import Pose
from patrol.values import wrong

if TYPE_CHECKING:
    from collections.abc import Sequence

    from patrol.changing.ground import Parts
    from patrol.closures.spec import ClosureSpec
    from patrol.energy.checks import ChargedRobot
    from patrol.energy.spec import DockSpec
    from patrol.ground.terrain import Terrain


def check_closures(closures: Sequence[ClosureSpec], paths: str, step: float) -> None:
    """Refuse closures that do not fit the rest of a scenario."""
    check_names([closure.name for closure in closures], "closure")
    if not closures:
        return
    if paths != "wave":
        limit = f"{paths} knows the map and no closures; set it to wave, or drop closures"
        raise wrong("patrol.options.paths", limit)
    for number, closure in enumerate(closures):
        check_ticks(closure.closed or (), step, f"closures.{number}.closed", closure.name)


def check_closures_on_ground(
    closable: Parts, terrain: Terrain, roster: Sequence[ChargedRobot], starts: Sequence[Pose], docks: Sequence[DockSpec]
) -> None:
    """Refuse closures that close nothing, or lie on starts or docks."""
    from patrol.ground.swept_path import free_fraction  # here: it loads kernels, and few scenarios have closures

    for number, (name, points) in enumerate(closable.items()):
        where = f"closures.{number}.polygon: {name}"
        if not points.size:
            raise BadInput(f"{where} holds no passable ground of {terrain.name}, which {terrain.span}; move or drop it")
        ground = with_closed(terrain, [points])
        for spec, start in zip(roster, starts, strict=True):
            if free_fraction(ground, start, start, spec.radius) < 1.0:
                coordinates = f"({start.x:g}, {start.y:g})"
                raise BadInput(
                    f"{where} lies on the start of {spec.name} at {coordinates}; move it, or give robots.starts"
                )
        for index, dock in enumerate(docks):
            pose = Pose(*dock.place, 0.0)
            widest = max(spec.radius for spec in roster if spec.battery is not None)
            if free_fraction(ground, pose, pose, widest) < 1.0:
                raise BadInput(f"{where} lies on docks.{index}; move one of them")
