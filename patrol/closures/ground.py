"""Ground some of whose points are closed for now, and the points that a sensor sees of it.

A robot that stands before a closed door sees the points up to it, and that the door's own points are blocked:

    . . . . # . .        R robot      . in sight
    . R . . x           x closed     the x beside a point in sight are its *face*, which the robot sees blocked
    . . . . x           blank: neither seen nor known
    . . . . # . .

The world shows a robot the faces, and the robot's own view of the ground without the points that it believes blocked
ends at the same points. So both use the code here.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from patrol.ground.footprint import Footprint, View
from patrol.ground.terrain import BoolGrid, Terrain, frozen_grid
from patrol.pose import Pose


class ChangingTerrain(Terrain):
    """A terrain of which points close and open: they stop bodies and sight while they are closed."""

    base: Terrain  # the terrain with nothing closed

    def __init__(self, base: Terrain) -> None:
        """Begin with nothing closed."""
        super().__init__(base.name, base.passable, base.point, base.origin, base.keep_out, base.source, base.against)
        vars(self)["base"] = base

    def close(self, closed: BoolGrid) -> None:
        """Close some points, and open all others."""
        vars(self)["passable"] = frozen_grid(self.base.passable & ~closed)
        for derived in ("free", "blocked", "room"):
            vars(self).pop(derived, None)


class ChangingFootprint(Footprint):
    """A sensor on ground of which points close and open.

    `closed`, bool (height, width), is True on points that are closed now.
    """

    terrain: ChangingTerrain  # the ground as it is now
    changes = True

    def __init__(self, make: Callable[[Terrain], Footprint], terrain: Terrain) -> None:
        """Begin with nothing closed; `make` is called again whenever the ground changes."""
        self._make = make
        self.terrain = ChangingTerrain(terrain)
        self.closed: BoolGrid = np.zeros(terrain.shape, dtype=np.bool_)
        self._now = now = make(self.terrain)
        self.range_m, self.radius, self.line_of_sight = now.range_m, now.radius, now.line_of_sight
        self.all_round, self.leaves_age = now.all_round, now.leaves_age

    def visible(self, pose: Pose) -> View:
        """The points seen from a pose, as doors are closed now."""
        return self._now.visible(pose)

    def close(self, closed: BoolGrid) -> None:
        """Close some points, and open all others; `closed` is copied."""
        if np.array_equal(closed, self.closed):
            return
        self.closed = closed.copy()
        self.terrain.close(closed)
        self._now = self._make(self.terrain)


def faces(view: View, closed: BoolGrid) -> NDArray[np.int64]:
    """Return the closed points that a view shows to be closed, as ascending flat indices.

    Those are the ones in it, or beside a point in it, diagonally too.
    """
    box = view.box(closed.shape)
    if box is None:
        return np.zeros(0, dtype=np.int64)
    first, last, left, right = box
    near = closed[first : last + 1, left : right + 1]
    if not near.any():
        return np.zeros(0, dtype=np.int64)
    visible = np.pad(
        view.mask[first - view.row0 : last + 1 - view.row0, left - view.col0 : right + 1 - view.col0] != 0, 1
    )
    across = visible[:, :-2] | visible[:, 1:-1] | visible[:, 2:]
    rows, cols = np.nonzero(near & (across[:-2] | across[1:-1] | across[2:]))
    return np.asarray((rows + first) * closed.shape[1] + cols + left, dtype=np.int64)
