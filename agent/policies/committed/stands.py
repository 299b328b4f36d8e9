"""Stands: the nearest place from which a robot can see its target."""

from __future__ import annotations

from typing import TYPE_CHECKING

from agent.policies.committed.kernels.stands import nearest_stand
from patrol.pose import Pose

if TYPE_CHECKING:
    from agent.policies.committed.cells import Cells
    from patrol.ground.footprint import Footprint


def nearest_in_sight(sight: Footprint, slack: int, cells: Cells, point: tuple[int, int]) -> tuple[int, int] | None:
    """The point with the shortest way from which a sensor shows a point.

    Args:
        sight: The sensor, which sees as far in every direction.
        slack: By how many points a robot may miss the place that it heads for.
        cells: Paths from where the robot stands.
        point: Row and column in the terrain of what is to be seen.

    Returns:
        Row and column of the terrain; None if none is known.
    """
    seen = sight.visible(Pose(*sight.terrain.centre(*point), 0.0))
    offset = seen.row0 - cells.row0, seen.col0 - cells.col0
    found = nearest_stand(seen.mask, slack, *offset, cells.cell, cells.limit)
    if found < 0:
        return None
    row, col = divmod(int(found), seen.mask.shape[1])
    return seen.row0 + row, seen.col0 + col
