"""The point that pulls hardest, found among the nearest points where nothing farther away can pull harder.

What is worth a robot's while mostly lies where its sight ends. So its paths are followed a little farther than that at
first, and then as far as something stale could still pull harder than what was found. The paths of rivals are followed
only to points that would pull hardest without them.

Here a choice is made as if two windows were looked at, a small one and then the whole terrain: the small one decides if
what it holds pulls harder than anything outside could, and knows no longer paths of rivals than its own.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.policies.committed.cells import NO_CELLS, Cells, Layer, around
from agent.policies.committed.kernels.rivals import rivals_within
from agent.policies.committed.kernels.strips import DECIDED, STRIP, hardest_of, posts_within, survey
from agent.routes.path_window import FAR
from agent.routes.wave import LONGEST

if TYPE_CHECKING:
    from agent.belief.posts import Posts
    from agent.policies.committed.search import Decay
    from agent.routes.routes import Element
    from agent.view import View

BEYOND_SIGHT = 1.25
"""How far paths are followed at first, in sensor ranges."""

TOP = 8
"""Strips that are looked at first, so that most of the others can be left out."""

ROUNDING = 1e-9
"""By how much a strip may pull less than a point and still be looked at, relative to the logarithm of the force."""

EVERY = 1000
"""Steps in which a limit is looked for, in hundredths of a point."""

NOBODY = np.zeros((0, 2), dtype=np.int64)

NONE_UNDECIDED = 0, 0, LONGEST, -1, LONGEST, -1
"""What `agent.policies.committed.kernels.strips.hardest_of` has noted before it begins."""


class Found(NamedTuple):
    """What pulls hardest.

    Attributes:
        force: Its logarithm.
        point: The point, row and column of the terrain.
        close: The point to stand on, likewise.
        cells: The robot's own paths.
        limit: The longest path that counts, in hundredths of a point.
    """

    force: float
    point: tuple[int, int]
    close: tuple[int, int]
    cells: Cells
    limit: int


class Searched(NamedTuple):
    """What came of a search.

    Attributes:
        best: What pulls hardest; None if nothing was found.
        sure: False if something pulls, but nothing bounds how far away something could pull harder.
    """

    best: Found | None
    sure: bool = True


class Surveyed(NamedTuple):
    """What is known of a robot's paths before any point is looked at.

    Attributes:
        cells: The paths.
        decay: As log_decay of `agent.policies.committed.kernels.hardest.hardest`, up to the longest path.
        bounds: float64 (m, s), see `agent.policies.committed.kernels.strips.survey`.
        posts: int32 (k, 4), the entries of the posts to which paths lead, of points that are old enough.
    """

    cells: Cells
    decay: NDArray[np.float64]
    bounds: NDArray[np.float64]
    posts: NDArray[np.int32]


class Question(NamedTuple):
    """What is asked for in one tick.

    Attributes:
        view: Of this tick.
        pull: As log_pull of `agent.policies.committed.kernels.hardest.hardest`.
        decay: The logarithm of g.
        others: int64 (n, 2), the points (row, col) of the terrain on which rivals stand.
        shunned: int64 (n, 3), see `agent.policies.committed.kernels.hardest.hardest`.
        least: Points younger than this are left out, ticks.
        hand_over: See `agent.policies.committed.kernels.hardest.hardest`.
    """

    view: View
    pull: NDArray[np.float64]
    decay: Decay
    others: NDArray[np.int64]
    shunned: NDArray[np.int64]
    least: int
    hand_over: int

    def beyond(self, limit: int) -> float:
        """The hardest that a point could pull whose path is longer than a limit in hundredths of a point."""
        return float(self.pull[-1] + self.decay.from_on(limit, limit + 1, 1)[0])


class Nearby:
    """Looks for the point that pulls hardest."""

    def __init__(self, posts: Posts, sight: float, near: int, width: float) -> None:
        """Lay no paths yet.

        Args:
            posts: The points on which no body fits.
            sight: The sensor's range, in points.
            near: How far the small window reaches, in hundredths of a point.
            width: Of the claims, in hundredths of a point; 0 without claims.
        """
        self._posts = posts
        self._near = near
        self._width = width
        self._decided = math.ceil(DECIDED * width)
        # Within this, the small window knows all paths of rivals that matter.
        self._first = max(0, min(math.ceil(100.0 * BEYOND_SIGHT * sight), near - self._decided))
        self._layer = Layer()

    def find(self, asked: Question, start: Element, *, whole: bool = False) -> Searched:
        """The point that pulls hardest, unless a rival's way there is shorter by more than is handed over.

        Args:
            asked: In this tick.
            start: The element of the ground on which the robot stands.
            whole: Whether to choose as if nothing but the whole terrain were looked at.

        Returns:
            What was found; nothing, for sure, where nothing within the small window pulls.
        """
        best, limit, known = None, self._near, LONGEST if whole else self._near
        for limit in (self._first, self._near) if self._first >= EVERY else (self._near,):
            best = self._hardest(asked, self._survey(asked, start, limit), limit, known)
            if best is not None:
                break
        if best is None or best.force > asked.beyond(limit):
            return Searched(best)
        needed = self._needed(asked, best.force, limit)
        if needed is None:
            return Searched(None, sure=False)
        own, least = self._survey(asked, start, needed), best.force
        if whole or needed <= self._near:
            return Searched(self._hardest(asked, own, needed, known, least))
        # Only what pulls harder than anything outside of the small window counts as found in it.
        outside = asked.beyond(self._near)
        best = self._hardest(asked, own, self._near, self._near, max(least, outside))
        if best is not None and best.force > outside:
            return Searched(best)
        return Searched(self._hardest(asked, own, needed, LONGEST, least))

    def find_far(self, asked: Question, start: Element) -> Found | None:
        """The point that pulls hardest of the whole terrain, for when the small window holds none.

        What rivals have the shorter way to counts only where nothing else pulls.

        Args:
            asked: In this tick.
            start: The element of the ground on which the robot stands.

        Returns:
            None where that takes a look at all paths, and while something is closed.
        """
        reach = self._reach(asked.view, start, asked.others, asked.hand_over)
        if reach is None:
            return None
        begin = min(max(self._near, reach), 2 * self._near)
        own = self._search_outward(asked, start, begin, reach)
        if own.best is not None or not own.sure or self._width == 0.0:
            return own.best
        handed_over = asked._replace(hand_over=FAR)
        return self._search_outward(handed_over, start, self._near, 100 * sum(asked.view.ground.terrain.shape)).best

    def claimed(self, view: View, start: Element, others: NDArray[np.int64]) -> int | None:
        """How far the robot's claimed ground reaches.

        Args:
            view: Of this tick.
            start: The element of the ground on which it stands.
            others: int64 (n, 2), the points (row, col) of the terrain on which rivals stand.

        Returns:
            Hundredths of a point; 0 where it claims nothing but its own place. None while something is closed, because
            rivals' paths then lead over other ground than the robot's own.
        """
        return self._reach(view, start, others, 0)

    def paths(self, view: View, start: Element, limit: int) -> Cells:
        """The robot's own paths.

        Args:
            view: Of this tick.
            start: The element of the ground on which it stands.
            limit: The longest, in hundredths of a point.
        """
        here = start[0] - 1, start[1] - 1
        return self._layer.lay(view.ground, [here], around([here], limit // 100 + 2, view.ground.terrain.shape), limit)

    def _reach(self, view: View, start: Element, others: NDArray[np.int64], lead: int) -> int | None:
        """As `claimed`, of the ground to which no rival has a way that is shorter by more than a lead."""
        if view.ground.static is not view.ground:
            return None
        rivals = others if self._width > 0.0 else NOBODY
        return self._layer.claimed(view.ground, (start[0] - 1, start[1] - 1), rivals, min(lead, LONGEST), LONGEST)

    def _search_outward(self, asked: Question, start: Element, begin: int, reach: int) -> Searched:
        """Look farther and farther away until something pulls, and then as far as something could pull harder.

        Args:
            asked: In this tick.
            start: The element of the ground on which the robot stands.
            begin: How far to look at first, in hundredths of a point; no less than the small window reaches.
            reach: How far to look at most for the first point that pulls, likewise.

        Returns:
            What pulls hardest of the whole terrain, if anything within reach pulls.
        """
        limit = begin
        best = self._hardest(asked, self._survey(asked, start, limit), limit, LONGEST)
        while best is None and limit < reach:
            limit = min(2 * limit, reach)
            best = self._hardest(asked, self._survey(asked, start, limit), limit, LONGEST)
        if best is None:
            return Searched(None)
        needed = self._needed(asked, best.force, self._near)
        if needed is None:
            return Searched(None, sure=False)
        if needed <= limit:
            return Searched(best)
        return Searched(self._hardest(asked, self._survey(asked, start, needed), needed, LONGEST, best.force))

    def _needed(self, asked: Question, force: float, least: int) -> int | None:
        """The length from which on nothing pulls as hard as a force, hundredths of a point; None without one."""
        weaker = force - ROUNDING * (1.0 + abs(force)) - asked.pull[-1]
        decay = asked.decay.from_on(least, 100 * sum(asked.view.ground.terrain.shape), EVERY)
        first = int((decay < weaker).argmax()) if decay.size else 0
        return least + first * EVERY if decay.size and decay[first] < weaker else None

    def _hardest(
        self, asked: Question, own: Surveyed, limit: int, known: int, least: float = -math.inf
    ) -> Found | None:
        """The point that pulls hardest.

        Args:
            asked: In this tick.
            own: The robot's own paths.
            limit: The longest that counts, in hundredths of a point; no longer than those surveyed.
            known: The longest path of a rival that counts, likewise.
            least: The logarithm of a force that some point is known to exert.
        """
        bounds, fog, best = own.bounds, asked.view.fog, np.empty(1)
        place, undecided = np.zeros(4, dtype=np.int64), np.zeros(6, dtype=np.int64)
        ages = fog.last_seen, fog.looked, asked.view.tick, asked.least

        def look(floor: float, posts: NDArray[np.int32], weakest: float, rival: Cells | None) -> float:
            best[0], undecided[:] = weakest, NONE_UNDECIDED
            others = asked.others if rival is None and self._width > 0.0 else NOBODY
            law = *ages, asked.pull, own.decay
            rivals = others, *(rival or NO_CELLS), self._width, asked.hand_over
            hardest_of(
                bounds, floor, posts, *own.cells[:3], limit, *law, *rivals, asked.shunned, best, place, undecided
            )
            return float(best[0])

        if least == -math.inf:
            top = np.partition(bounds.reshape(-1), -TOP)[-TOP] if bounds.size > TOP else least
            least = look(float(top), own.posts[:0], least, None)
        floor = least - ROUNDING * (1.0 + abs(least)) if math.isfinite(least) else least
        hardest = look(floor, own.posts, floor, None)
        if undecided[0] and hardest > floor:
            hardest = look(floor, own.posts, hardest, None)
        if undecided[0]:
            hardest = look(floor, own.posts, floor, self._rivals(asked, undecided, known))
        if hardest == floor:
            return None
        row, col, stand_row, stand_col = place.tolist()
        return Found(hardest, (row, col), (stand_row, stand_col), own.cells, known)

    def _survey(self, asked: Question, start: Element, limit: int) -> Surveyed:
        """Lay the robot's own paths up to a length in hundredths of a point, and find what they lead to."""
        own, fog, tick = self.paths(asked.view, start, limit), asked.view.fog, asked.view.tick
        rows, cols = own.cell.shape
        decay = asked.decay.table(limit)
        bounds = np.empty((rows, -(-cols // STRIP)))
        survey(own.cell, limit, fog.last_seen, own.row0, own.col0, tick, asked.pull, decay, bounds)
        posts = self._posts.between(own.row0 + 1, own.row0 + rows - 2)
        found = np.empty_like(posts)
        count = posts_within(posts, *own[:3], limit, fog.last_seen, tick, asked.least, found)
        return Surveyed(own, decay, bounds, found[:count])

    def _rivals(self, asked: Question, undecided: NDArray[np.int64], known: int) -> Cells:
        """The paths of rivals to points that they may have a claim to."""
        longest, top, bottom, left, right = undecided[1:].tolist()
        limit = min(longest + self._decided, known)
        near = np.empty_like(asked.others)
        count = rivals_within(asked.others, limit, top, bottom, left, right, near)
        if not count:
            return NO_CELLS
        starts = [(row, col) for row, col in near[:count].tolist()]
        # Half of such a path is near its one end, and half of it near the other.
        ground = asked.view.ground
        box = around([(top, left), (bottom, right), *starts], limit // 200 + 2, ground.terrain.shape)
        return self._layer.lay(ground.static, starts, box, limit)
