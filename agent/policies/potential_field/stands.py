"""Stands: the nearest place from which a robot can see its target."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agent.routes.ground import eroded
from agent.routes.kernels.wave import BLOCKED, SETTLED, STATUS
from patrol.pose import Pose

if TYPE_CHECKING:
    from agent.routes.path_window import PathWindow
    from patrol.ground.footprint import Footprint


def nearest_in_sight(
    sight: Footprint, slack: int, paths: PathWindow, point: tuple[int, int], ground: NDArray[np.uint8] | None
) -> tuple[int, int] | None:
    """The point with the shortest way from which a sensor shows a point.

    Args:
        sight: The sensor, which sees as far in every direction.
        slack: By how many points a robot may miss the place that it heads for.
        paths: From where the robot stands.
        point: Row and column in the terrain of what is to be seen.
        ground: uint8, what is open now and what blocked, where paths lead over both; the window then holds all of it.

    Returns:
        Row and column of the terrain; None if none is known.
    """
    seen = sight.visible(Pose(*sight.terrain.centre(*point), 0.0))
    rows, cols = np.nonzero(seen.mask)
    if slack:
        inner = np.nonzero(eroded(seen.mask, slack))
        if inner[0].size:
            rows, cols = inner
    rows, cols = rows + seen.row0 - paths.row0, cols + seen.col0 - paths.col0
    inside = (rows >= 0) & (rows < paths.state.shape[0]) & (cols >= 0) & (cols < paths.state.shape[1])
    rows, cols = rows[inside], cols[inside]
    known = paths.state[rows, cols] & STATUS == SETTLED
    if ground is not None:
        known &= ground[rows, cols] & STATUS != BLOCKED
    rows, cols = rows[known], cols[known]
    if not rows.size:
        return None
    nearest = int(np.argmin(paths.length[rows, cols]))
    return int(rows[nearest]) + paths.row0, int(cols[nearest]) + paths.col0
