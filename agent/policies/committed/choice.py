"""The choice of a target: the point with the greatest age squared per way.

A point of age a (s) at the end of a way of length L (m) counts a^2 / (L + `NEAR_M`), and a tenth of that where another
robot has the shorter way (`OTHERS`). So a patrol goes for what is stale, finishes what is close by, and leaves to each
robot the ground around it, without a word between them.

The search lays one wave of path lengths from the robot and one from all others at once, over a box around the robot.
No point outside of the box can count more than the greatest age squared per the box's reach. The box doubles until the
best point inside counts that much; so the choice is the one that the whole terrain would give.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.policies.committed.kernels.best import best_of
from agent.routes.box_lengths import NO_LENGTHS, Box, BoxLengths, BoxWave, box_around
from agent.routes.wave import LONGEST

if TYPE_CHECKING:
    from agent.policies.committed.given_up import GivenUp
    from agent.ports import PolicySetup
    from agent.routes.routes import Element
    from agent.view import View

NEAR_M = 3.0
"""Added to each way, m: among points that are nearer than this, age decides."""

OTHERS = 0.1
"""Share that a point counts to which another robot has the shorter way."""

FIRST_REACH = 1.25
"""Reach of the first box, in sensor ranges."""

NO_POINTS: NDArray[np.int32] = np.zeros((0, 4), dtype=np.int32)

Point = tuple[int, int]
"""Row and column of the terrain."""


class Best(NamedTuple):
    """The best point that a search has found.

    Attributes:
        point: The point to be seen.
        stand: The point to go to: the same, or its post where no body fits.
        length: Of the way there, and a little more, in hundredths of a point.
    """

    point: Point
    stand: Point
    length: int


class Choice:
    """Searches for a robot's targets; keeps the working memory of its waves."""

    def __init__(self, setup: PolicySetup) -> None:
        """Take what the search needs to know of the robot and the terrain.

        Args:
            setup: The policy's.
        """
        point = setup.terrain.point
        self._posts = setup.posts
        self._near = 100.0 * NEAR_M / point
        self._first_reach = math.ceil(FIRST_REACH * setup.sensor.range / point)
        self._wave = BoxWave()

    def best(self, view: View, start: Element, rivals: NDArray[np.int64], given_up: GivenUp) -> Best | None:
        """Find the point that counts most.

        Args:
            view: Of this tick.
            start: The element of the ground on which the robot stands.
            rivals: int64 (n, 2), the elements of the static ground on which other robots stand.
            given_up: What is left out, unless nothing else is left.

        Returns:
            The point, or None where nothing is stale.
        """
        left_out = given_up.now(view.tick)
        best = self._search(view, start, rivals, left_out)
        if best is None and left_out.size:
            given_up.clear()
            best = self._search(view, start, rivals, given_up.now(view.tick))
        return best

    def _search(
        self, view: View, start: Element, rivals: NDArray[np.int64], left_out: NDArray[np.int64]
    ) -> Best | None:
        here, shape = (start[0] - 1, start[1] - 1), view.ground.terrain.shape
        others = [(row - 1, col - 1) for row, col in rivals.tolist()]
        worth = np.arange(view.mfow + 1.0) ** 2
        score, place = np.zeros(1), np.zeros(4, dtype=np.int64)
        reach = self._first_reach
        while True:
            box, limit = box_around(here, reach, shape), 100 * reach
            if 2 * (box[1] - box[0]) * (box[3] - box[2]) >= shape[0] * shape[1]:
                box, limit = (0, shape[0], 0, shape[1]), LONGEST
            # A robot with a shorter way to a point of the box is at most twice as far away as its edge.
            wide = box if limit == LONGEST else box_around(here, 2 * reach, shape)
            own = self._wave.lengths(view.ground, [here], box, limit)
            rival = self._of_rivals(view, others, wide, limit)
            fog = view.fog
            for points in (None, self._posts.between(box[0], box[1] - 1)):
                listed = NO_POINTS if points is None else points
                grids = (*own[:3], limit, *rival[:3], fog.last_seen, fog.looked, view.tick)
                best_of(listed, points is not None, *grids, worth, self._near, OTHERS, left_out, score, place)
            if limit == LONGEST or score[0] >= worth[-1] / (limit + self._near):
                break
            reach *= 2
        if score[0] <= 0.0:
            return None
        row, col, stand_row, stand_col = (int(number) for number in place)
        return Best((row, col), (stand_row, stand_col), own.length(stand_row, stand_col) + 200)

    def _of_rivals(self, view: View, others: list[Point], box: Box, limit: int) -> BoxLengths:
        """Lay the paths from the other robots in a box."""
        near = [(row, col) for row, col in others if box[0] <= row < box[1] and box[2] <= col < box[3]]
        return self._wave.lengths(view.ground.static, near, box, limit) if near else NO_LENGTHS
