"""The choice of a target: the point with the greatest age squared per way.

A point of age a (s) at the end of a way of length L (m) counts a^2 / (L + `NEAR_M`), and a tenth of that where another
robot has the shorter way (`OTHERS`). So robots prefer stale points, finish the ones close by first, and rarely choose
the same ones, although no robot says which target it has. On ground with zones an age counts times the point's weight.

The search lays one wave of path lengths from the robot and one from all others at once, over a box around the robot.
Outside of the box a point counts at most its age squared per its distance as the crow flies. Where that is enough to
beat the best point inside, the box grows. So the choice is the one that the whole terrain would give.

Robots outside of the box are left out of the wave. One of them can have the shorter way only to a point that is
farther from this robot than half the box's reach; where the best point is, the box grows. All points to which this
robot has the shortest way form one patch around it, because a robot that is nearer to a point of a path is nearer to
the path's end too. So where the patch ends within half the box's reach, every point outside of the box counts a tenth.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.kernels.best import any_nearer, best_of, farthest_of_own, oldest_that_may_win
from agent.routes.wave import LONGEST, NO_PATHS, Box, BoxPaths, box_around, paths_in
from patrol.measures.zoned import zoned_ground

if TYPE_CHECKING:
    from agent.policies.commitment import GivenUp
    from agent.ports import PolicySetup
    from agent.routes.routes import Element
    from agent.view import View

NEAR_M = 3.0
"""Added to each way, m: among points that are nearer than this, age decides."""

OTHERS = 0.1
"""Share that a point counts to which another robot has the shorter way."""

FIRST_REACH = 1.25
"""Reach of the first box, in sensor ranges."""

BESIDE_POINTS = 2
"""Rows or columns, at most, between a robot and the point where its paths begin."""

MOST_AGE = 1e5
"""Greatest age times weight, ticks; where one is greater, all are made smaller by one factor."""

ROUNDING = 1e-9
"""Share by which a bound is lowered, so that no rounding makes it too high."""

NO_POINTS: NDArray[np.int32] = np.zeros((0, 4), dtype=np.int32)

Point = tuple[int, int]
"""Row and column of the terrain."""


class Best(NamedTuple):
    """The best point that a search has found."""

    point: Point
    stand: Point  # the point to go to: the same, or its post where no body fits
    length: int  # of the way there, and a little more, in hundredths of a point


class Ages(NamedTuple):
    """The ages of the points, as far as a choice is concerned; a point in view has none."""

    patrolled: NDArray[np.bool_]  # (h, w), the points that have an age
    last_seen: NDArray[np.int32]  # (h, w), ticks
    looked: NDArray[np.int32]  # (h, w), ticks when last in view
    tick: int
    oldest: int  # the greatest age, ticks


class TargetChoice:
    """The search for a robot's targets."""

    def __init__(self, setup: PolicySetup) -> None:
        point = setup.ground.terrain.point
        self.posts = setup.ground.posts
        self._near = 100.0 * NEAR_M / point
        self._least_reach = math.ceil(FIRST_REACH * setup.ground.sight.range_m / point)
        self._reach = self._least_reach
        self._prepared = setup.ground.prepared

    def best(
        self,
        view: View,
        start: Element,
        rivals: NDArray[np.float64],
        given_up: GivenUp,
    ) -> Best | None:
        """Find the point that counts most, or return None where nothing is stale.

        What was given up is left out, unless nothing else is left.
        """
        left_out = given_up.now(view.tick)
        ages = self._ages(view)
        worth = np.arange(ages.oldest + 1.0) ** 2
        best = self._search(view, ages, start, rivals, left_out, worth)
        if best is None and left_out.size:
            given_up.clear()
            best = self._search(view, ages, start, rivals, given_up.now(view.tick), worth)
        return best

    def _ages(self, view: View) -> Ages:
        """Return the believed ages, times their weights on ground with zones."""
        fog = view.fog
        zoned = zoned_ground(self._prepared, view.weighing)
        if zoned is None:
            return Ages(fog.patrolled, fog.last_seen, fog.looked, view.tick, view.mfow)
        counts = fog.patrolled & (fog.looked != view.tick)
        weighted = np.where(counts, zoned.weights * (view.tick - np.maximum(fog.last_seen, 0)), 0.0)
        oldest = float(weighted.max())
        if oldest > MOST_AGE:
            weighted *= MOST_AGE / oldest
        ages = np.rint(weighted).astype(np.int32)
        most = int(ages.max())
        last_seen = np.ascontiguousarray(np.int32(most) - ages)
        return Ages(np.ascontiguousarray(counts), last_seen, last_seen, most, most)

    def _search(
        self,
        view: View,
        ages: Ages,
        start: Element,
        rivals: NDArray[np.float64],
        left_out: NDArray[np.int64],
        worth: NDArray[np.float64],
    ) -> Best | None:
        if worth[-1] == 0.0:
            return None
        here, shape = (start[0] - 1, start[1] - 1), view.ground.terrain.shape
        reach = self._reach
        while True:
            box, limit = box_around(here, reach, shape), 100 * reach
            if 2 * (box[1] - box[0]) * (box[3] - box[2]) >= shape[0] * shape[1]:
                box, limit = (0, shape[0], 0, shape[1]), LONGEST
            own, rival = paths_in(view.ground, [here], box, limit), NO_PATHS
            score, place = self._best_in(ages, own, rival, worth, left_out)
            if score > 0.0 and _may_be_nearer(view, rivals, place[2:], own.length_to(*place[2:])):
                rival = _paths_of_rivals(view, rivals, box, limit)
                score, place = self._best_in(ages, own, rival, worth, left_out)
                length = own.length_to(*place[2:])
                if limit != LONGEST and 2 * length > limit and rival.length_to(*place[2:]) >= length:
                    reach = math.ceil(length / 50)
                    continue
            patch_ends = 2 * farthest_of_own(own.length, rival.length, limit) <= limit
            to_beat = score / OTHERS if patch_ends else score
            enough = self._enough(ages, here, worth, to_beat, 2 * reach) if score > 0.0 else 2 * reach
            if limit == LONGEST or reach >= enough:
                break
            reach = min(enough, 2 * reach)
        if score <= 0.0:
            return None
        # The next search begins with the box that would have done for this one.
        self._reach = min(max(self._least_reach, enough), max(shape))
        return Best(place[:2], place[2:], own.length_to(*place[2:]) + 200)

    def _enough(self, ages: Ages, here: Point, worth: NDArray[np.float64], score: float, most: int) -> int:
        """Return the reach of a box that holds each way at the end of which a point could have a score, or more.

        Of a larger box than `most`, it returns no more than that it is as large.
        """
        score *= 1.0 - ROUNDING

        def longest(age: int) -> int:
            return math.ceil((worth.item(age) / score - self._near) / 100.0)

        gap = self.posts.gap
        around = (*here, longest(-1) + gap, gap)
        too_old = int(np.searchsorted(worth, score * (100.0 * most + self._near)))
        oldest = oldest_that_may_win(
            ages.patrolled, ages.last_seen, ages.tick, *around, worth, self._near, score, too_old
        )
        return longest(int(oldest))

    def _best_in(
        self,
        ages: Ages,
        own: BoxPaths,
        rival: BoxPaths,
        worth: NDArray[np.float64],
        left_out: NDArray[np.int64],
    ) -> tuple[float, tuple[int, int, int, int]]:
        """Return the best score in a box, 0 without any, and row and column of the point and of where to stand."""
        score, place = np.zeros(1), np.zeros(4, dtype=np.int64)
        known = (own.length, own.row0, own.col0, own.limit, rival.length, rival.row0, rival.col0)
        grids = (*known, ages.patrolled, ages.last_seen, ages.looked, ages.tick)
        posts = self.posts.between(own.row0 + 1, own.row0 + own.length.shape[0] - 2)
        for points, listed in ((NO_POINTS, False), (posts, True)):
            best_of(points, listed, *grids, worth, self._near, OTHERS, left_out, score, place)
        row, col, stand_row, stand_col = place.tolist()
        return float(score[0]), (row, col, stand_row, stand_col)


def _paths_of_rivals(view: View, rivals: NDArray[np.float64], box: Box, limit: int) -> BoxPaths:
    """Find the paths from the other robots in a box."""
    ground, (top, bottom, left, right) = view.ground.static, box
    low, high = np.array(ground.terrain.centre(top, left)), np.array(ground.terrain.centre(bottom, right))
    beside = BESIDE_POINTS * ground.terrain.point
    close = rivals[((rivals > low - beside) & (rivals < high + beside)).all(axis=1)]
    elements = [(row - 1, col - 1) for row, col in ground.join_each(close).tolist()]
    starts = [(row, col) for row, col in elements if top <= row < bottom and left <= col < right]
    return paths_in(ground, starts, box, limit) if starts else NO_PATHS


def _may_be_nearer(view: View, rivals: NDArray[np.float64], stand: Point, length: int) -> bool:
    """Return True if another robot could have a shorter way to a point with nothing in between.

    No score grows by the rivals' ways. So the best point without them is the best one where this is False.
    """
    points = length / 100.0 + 1.5 * BESIDE_POINTS
    return bool(any_nearer(rivals, *view.place_of(stand), view.ground.terrain.point * points))
