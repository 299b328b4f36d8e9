"""Ground that is believed blocked: places that could not be reached.

Theory of operation
    The belief is that of one robot. It stays there, because positions are all that robots exchange. A point is
    believed blocked from when the robot sees it blocked or bumps into it, until it sees it free, or until it has not
    seen it for `memory` ticks. The robot's sensor is computed on the map without these points
    (`patrol.changing.ground`). A point that this view shows, and that the robot's senses do not report, is free.

    For its ways the robot leaves out all points nearer to blocked ones than its planning radius. What it can reach then
    is the part of the ground that it stands in. Where it stands to see each point is found anew for this part
    (`patrol.ground.fields.proxies_of`). What it cannot see from there is *left out* of the fog that its policy sees,
    until the belief changes. So it is with a wreck that the robot has bumped into, for as long as it believes it there.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agent.routes.ground import Area
from patrol.changing.ground import ChangingFootprint, faces
from patrol.exchange import MOST_BLOCKED
from patrol.ground.cspace import clearance_levels, needed_level, parts_of
from patrol.ground.fields import StaticFields, proxies_of
from patrol.ground.shapes import points_near
from patrol.radio.message import as_received

if TYPE_CHECKING:
    from collections.abc import Mapping

    from agent.belief.posts import Posts
    from agent.routes.ground import Disc
    from patrol.exchange import Sensed
    from patrol.ground.footprint import Footprint
    from patrol.ground.terrain import BoolGrid


UNSEEN = -1


class Blocked:
    """The points that one robot believes blocked.

    `grid`, bool (h, w), has the points, and `area` is where the robot's centre may not be because of them; None while
    there are none. `left_out`, bool (h, w), has the patrolled points that it cannot get to see. `stands`, int64 (h w,),
    is the flat index of where to stand to see each point, -1 for nowhere. Both are None while nothing is in its way.
    """

    def __init__(
        self, footprint: Footprint, fields: StaticFields, radius: float, memory: int, posts: Posts | None = None
    ) -> None:
        """Begin with nothing blocked.

        `footprint` is the robot's sensor; where the ground changes it is kept up to date with the belief, and so
        are `posts`, where the policy stands to see points. A blocked point that is not seen is forgotten after `memory`
        ticks. `radius` is in m.
        """
        self._posts = posts
        self._footprint = footprint
        self._fields = fields
        self._level = needed_level(radius, footprint.terrain.point)
        self._margin = int(np.ceil(np.sqrt(self._level))) // 2 + 2
        self._memory = memory
        # A grid for each robot of a large fleet takes much memory, so there is none where nothing changes.
        shape = footprint.terrain.shape if isinstance(footprint, ChangingFootprint) else (0, 0)
        self._seen_at: NDArray[np.int32] = np.full(shape, UNSEEN, dtype=np.int32)
        self.grid: BoolGrid = np.zeros(footprint.terrain.shape, dtype=np.bool_)
        self.area: Area | None = None
        self.left_out: BoolGrid | None = None
        self.stands: NDArray[np.int64] | None = None
        self._parts: NDArray[np.int32] | None = None
        self._part = 0
        self._wrecks: Mapping[tuple[int, int], Disc] = {}

    def sense(self, sensed: Sensed) -> None:
        """Take in the robot's senses, before it looks around."""
        if not isinstance(self._footprint, ChangingFootprint) or (not sensed.blocked and self.area is None):
            return
        seen_at = self._seen_at.reshape(-1)
        blocked = np.array(sensed.blocked, dtype=np.int64)
        # Senses come from another process, so an index may lie off the grid.
        blocked = blocked[blocked < seen_at.size]
        seen_at[blocked] = sensed.k
        grid = (self._seen_at != UNSEEN) & (self._seen_at >= sensed.k - self._memory)
        self._footprint.close(grid)
        here = as_received(sensed.pose)
        # A full list may leave out points that are blocked.
        while (
            len(sensed.blocked) < MOST_BLOCKED
            and (free := np.setdiff1d(faces(self._footprint.visible(here), grid), blocked)).size
        ):
            grid.reshape(-1)[free] = False
            self._footprint.close(grid)
        self._seen_at[~grid] = UNSEEN
        if not np.array_equal(grid, self.grid):
            self.grid = grid
            self._note_change()

    def bar(self, wrecks: Mapping[tuple[int, int], Disc]) -> None:
        """Take in the wrecks that are closed now, as `Obstacles.met` has them."""
        if wrecks.keys() != self._wrecks.keys():
            self._wrecks = wrecks
            self._note_change()

    @property
    def is_in_the_way(self) -> bool:
        """True while something is."""
        return self.area is not None or bool(self._wrecks)

    def stand_at(self, point: tuple[int, int] | None) -> None:
        """Bring `left_out` up to date with the part of the ground in which the robot stands.

        `point` is the (row, column) on which it stands or which it joins; None for a robot that is off the ground.
        """
        if not self.is_in_the_way or point is None:
            return
        terrain = self._footprint.terrain
        if self._parts is None:
            open_now = self._fields.reach.copy()
            if self.area is not None:
                top, bottom, left, right = self.area.box
                open_now[top - 1 : bottom - 1, left - 1 : right - 1] &= ~self.area.mask
            for x, y, reach in self._wrecks.values():
                open_now &= ~points_near(terrain, (x, y), reach + 0.5 * terrain.point)
            self._parts, _ = parts_of(open_now)
            self._part = 0
        part = int(self._parts[point])
        if part == 0 and self._part == 0:
            # It stands where no centre may be, such as right beside a wreck, and gets out the nearest way.
            part = _nearest_part(self._parts, point)
        if part in (0, self._part):
            return
        self._part = part
        reached = self._parts == part
        proxy = proxies_of(terrain, reached, self._footprint.range_m, self._footprint.line_of_sight)
        proxy[~self._fields.patrolled] = -1
        self.left_out = self._fields.patrolled & ~reached & (proxy < 0)
        self.stands = np.where(reached, np.arange(reached.size).reshape(reached.shape), proxy).reshape(-1)
        if self._posts is not None:
            self._posts.move(proxy)

    def _note_change(self) -> None:
        self._parts = None
        if not self.grid.any():
            self.area = None
            if not self._wrecks:
                self.left_out = self.stands = None
                if self._posts is not None:
                    self._posts.move(self._fields.proxy)
            return
        rows, cols = np.nonzero(self.grid)
        height, width = self.grid.shape
        margin = self._margin
        top, bottom = max(int(rows.min()) - margin, 0), min(int(rows.max()) + margin + 1, height)
        left, right = max(int(cols.min()) - margin, 0), min(int(cols.max()) + margin + 1, width)
        # Padded, so that the edge of the cut is no obstacle.
        free = np.pad(~self.grid[top:bottom, left:right], margin, constant_values=True)
        close = clearance_levels(free, margin)[margin:-margin, margin:-margin] < self._level
        away = np.zeros(self.grid.shape, dtype=np.bool_)
        away[top:bottom, left:right] = close
        self.area = Area(away)


def _nearest_part(parts: NDArray[np.int32], point: tuple[int, int]) -> int:
    """Return the part that begins nearest to a point; 0 where there are no parts."""
    rows, cols = np.nonzero(parts)
    if not rows.size:
        return 0
    nearest = int(((rows - point[0]) ** 2 + (cols - point[1]) ** 2).argmin())
    return int(parts[rows[nearest], cols[nearest]])
