"""Closure check: the area of each closure, what lies behind it, and what it closes out while it alone is closed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from patrol.closures import ClosedPoints
from patrol.ground.closed import ChangingTerrain
from patrol.ground.cspace import cspace_of, parts_of
from patrol.journal.records import CLOSED, Event
from patrol.measures.open_ground import OpenGround

if TYPE_CHECKING:
    from patrol.ground.terrain import Terrain
    from patrol.prepare import Prepared


def closure_lines(prepared: Prepared) -> Iterator[str]:
    """Yield the result of a check of closures as lines of text."""
    scenario, area = prepared.scenario, prepared.terrain.point_area
    yield f"closures: {len(scenario.closures)}"
    starts = {spec.number: start for spec, start in zip(scenario.roster, prepared.starts, strict=True)}
    places = {number: (start.x, start.y) for number, start in starts.items()}
    for closure in scenario.closures:
        closed = ClosedPoints(scenario.closures, prepared.terrain)
        closed.take(Event(0, CLOSED, None, closure.name))
        ground = ChangingTerrain(prepared.terrain)
        ground.close(closed.grid)
        open_ground = OpenGround(prepared)
        open_ground.tick(0, ground, closed.names, places)
        out = np.count_nonzero(open_ground.closed_out) * area
        from_one_side = OpenGround(prepared)
        from_one_side.tick(0, ground, closed.names, _largest_side(prepared, ground))
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
