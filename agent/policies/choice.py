"""Free choice of a target: the point with the greatest age squared per way.

A point of age a (s) at the end of a way of length L (m) counts a^2 / (L + `NEAR_M`), and a tenth of that where another
robot has the shorter way (`OTHERS`). So robots prefer stale points, finish the ones close by first, and rarely choose
the same ones, although no robot says which target it has. On ground with zones an age counts times the point's weight.
For example, a point not seen for 60 s at the end of a way of 9 m counts 60^2 / (9 + 3) = 300; one not seen for 90 s,
27 m away, 270. The first one is the target.

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

from agent.kernels.best import any_nearer, best_of, longest_own_way, oldest_that_may_win, those_within
from agent.policies.pursuit import TRIES, Point, Target, age_of
from agent.routes.ground import NO_PATHS, BoxPaths
from agent.routes.wave import LONGEST, Box, box_around, paths_in
from patrol.measures.zoned import ZonedGround
from patrol.radio.peers import places_of

if TYPE_CHECKING:
    from agent.policies.pursuit import GivenUp, Pursuit
    from agent.ports import PolicySetup
    from agent.routes.routes import Element, Way
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
"""Greatest age times weight, ticks; where one is greater, all are made smaller by one factor, as for a count of ticks
that has been moved by weeks."""

ROUNDING = 1e-9
"""Share by which a bound is lowered, so that no rounding makes it too high."""

NO_RIVALS: NDArray[np.float64] = np.zeros((0, 2))


class Best(NamedTuple):
    """The best point that a search has found."""

    score: float  # 0 where there is none
    point: Point
    stand: Point  # the point to go to: the same, or its post where no body fits
    length: int  # of the way there, in hundredths of a point


class Ages(NamedTuple):
    """The ages of the points, as far as a choice is concerned; a point in view has none."""

    patrolled: NDArray[np.bool_]  # (h, w), the points that have an age
    last_seen: NDArray[np.int32]  # (h, w), ticks
    looked: NDArray[np.int32]  # (h, w), ticks when last in view
    tick: int
    oldest: int  # the greatest age, ticks


class FreeChoice:
    """The free choice of a robot's targets."""

    waits = False

    def __init__(self, setup: PolicySetup) -> None:
        point = setup.ground.terrain.point
        self.posts = setup.ground.posts
        self._has_claims = "claims" in setup.options.separations
        self._near = 100.0 * NEAR_M / point
        self._least_reach = math.ceil(FIRST_REACH * setup.ground.sight.range_m / point)
        self._reach = self._least_reach
        scratch = setup.ground.scratch
        if "zones" not in scratch:
            scratch["zones"] = ZonedGround(setup.ground.prepared)
        self.zones: ZonedGround = scratch["zones"]

    def note(self, view: View, pursuit: Pursuit) -> bool:
        """Return True, as each choice is free."""
        del view, pursuit
        return True

    def forget(self) -> None:
        """Do nothing, as nothing is kept."""

    def next(self, view: View, start: Element, pursuit: Pursuit) -> Way | None:
        """Commit to the best point of all, and return the way there."""
        rivals = places_of(view.peers) if self._has_claims else NO_RIVALS
        for _ in range(TRIES):
            best = self.best(view, start, rivals, pursuit.given_up)
            if best is None:
                return None
            target = Target(best.point, best.stand, age_of(view, best.point), free=True)
            way = pursuit.go_to(view, start, target, best.length + 200)
            if way is not None:
                return way
            pursuit.given_up.add(view.tick, best.stand)
        return None

    def best(self, view: View, start: Element, rivals: NDArray[np.float64], given_up: GivenUp) -> Best | None:
        """Find the point that counts most, or return None where nothing is stale.

        Places given up are left out, unless nothing else is left.
        """
        left_out = given_up.now(view.tick)
        ages = self._weigh_ages(view)
        best = self._search_best(view, ages, start, rivals, left_out)
        if best is None and left_out.size:
            given_up.clear()
            best = self._search_best(view, ages, start, rivals, left_out[:0])
        return best

    def _weigh_ages(self, view: View) -> Ages:
        """Return the believed ages, times their weights on ground with zones, at most `MOST_AGE`."""
        fog = view.fog
        weights = self.zones.under(view.weighing)
        if weights is None and view.mfow <= MOST_AGE:
            return Ages(fog.patrolled, fog.last_seen, fog.looked, view.tick, view.mfow)
        counts = fog.patrolled & (fog.looked != view.tick)
        weighted = np.where(counts, 1.0 * (view.tick - np.maximum(fog.last_seen, 0)), 0.0)
        if weights is not None:
            # Below 1, ages would be rounded to 0.
            weighted *= weights / weights.min(where=fog.patrolled, initial=np.inf)
        oldest = float(weighted.max())
        if oldest > MOST_AGE:
            weighted *= MOST_AGE / oldest
        rounded = np.rint(weighted).astype(np.int32)
        greatest = int(rounded.max())
        last_seen = np.ascontiguousarray(np.int32(greatest) - rounded)
        return Ages(np.ascontiguousarray(counts), last_seen, last_seen, greatest, greatest)

    def _search_best(
        self, view: View, ages: Ages, start: Element, rivals: NDArray[np.float64], left_out: NDArray[np.int64]
    ) -> Best | None:
        if ages.oldest <= 0:
            return None
        worth = np.arange(ages.oldest + 1.0) ** 2
        here, shape = (start[0] - 1, start[1] - 1), view.ground.terrain.shape
        reach = self._reach
        while True:
            box, limit = box_around(here, reach, shape), 100 * reach
            if 2 * (box[1] - box[0]) * (box[3] - box[2]) >= shape[0] * shape[1]:
                box, limit = (0, shape[0], 0, shape[1]), LONGEST
            own_paths, rival = paths_in(view.ground, [here], box, limit), NO_PATHS
            best = self._best_in(ages, own_paths, rival, worth, left_out)
            if best.score > 0.0 and _may_be_nearer(view, rivals, best):
                rival = _paths_of_rivals(view, rivals, box, limit)
                best = self._best_in(ages, own_paths, rival, worth, left_out)
                is_own = rival.length_to(*best.stand) >= best.length
                if limit != LONGEST and 2 * best.length > limit and is_own:
                    reach = math.ceil(best.length / 50)
                    continue
            enough = 2 * reach
            if best.score > 0.0:
                patch_ends = 2 * longest_own_way(own_paths.length, rival.length, limit) <= limit
                to_beat = best.score / OTHERS if patch_ends else best.score
                enough = self._find_reach(ages, here, worth, to_beat, 2 * reach)
            if limit == LONGEST or reach >= enough:
                break
            reach = min(enough, 2 * reach)
        if best.score <= 0.0:
            return None
        # The next search begins with the box that would have done for this one.
        self._reach = min(max(self._least_reach, enough), max(shape))
        return best

    def _find_reach(self, ages: Ages, here: Point, worth: NDArray[np.float64], score: float, most: int) -> int:
        """Return the reach of a box that holds the ways to all points that could have a score or more.

        Any reach above `most` means only that the box is larger than that.
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
        self, ages: Ages, own: BoxPaths, rival: BoxPaths, worth: NDArray[np.float64], left_out: NDArray[np.int64]
    ) -> Best:
        """Return the best point in a box, or one without a score."""
        posts = self.posts.between(own.row0 + 1, own.row0 + own.length.shape[0] - 2)
        paths = (own.length, own.row0, own.col0, own.limit, rival.length)
        score, *point = best_of(posts, *paths, *ages[:4], worth, self._near, OTHERS, left_out)
        row, col, stand_row, stand_col, length = point
        return Best(score, (row, col), (stand_row, stand_col), length)


def _paths_of_rivals(view: View, rivals: NDArray[np.float64], box: Box, limit: int) -> BoxPaths:
    """Find the paths from the other robots in a box."""
    ground, (top, bottom, left, right) = view.ground.static, box
    (x_min, y_min), (x_max, y_max) = ground.terrain.centre(top, left), ground.terrain.centre(bottom, right)
    beside = BESIDE_POINTS * ground.terrain.point
    close = rivals[those_within(rivals, x_min - beside, y_min - beside, x_max + beside, y_max + beside)]
    # A few may lie outside of the box.
    starts = ground.join_each(close) - 1
    return paths_in(ground, starts, box, limit) if starts.size else NO_PATHS


def _may_be_nearer(view: View, rivals: NDArray[np.float64], best: Best) -> bool:
    """Return True if another robot could have a shorter way to the best point with nothing in between.

    No score grows by the rivals' ways. So the best point without them is the best one where this is False.
    """
    longest_m = view.ground.terrain.point * (best.length / 100.0 + 1.5 * BESIDE_POINTS)
    return bool(any_nearer(rivals, *view.place_of(best.stand), longest_m))
