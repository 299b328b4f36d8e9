"""Passing in narrow places: which of two robots that block each other goes back, and how far, from positions alone.

In a corridor that is too narrow for two, giving way does not help: there is no way round the other robot. One of the
two has to go back to where the other can get past it, and wait there:

      +------+              +------+
      |      +--------------+      |        1 and 2 have met in the corridor. 2 has less far to go back to a place
      |              1 > < 2     R |        where it is in nobody's way (R), so it goes there. 1 waits until there is
      |      +--------------+      |        room, then drives on, past R.
      +------+              +------+

A place is a *refuge* where a robot that stands there parts the ground around it into no two pieces: not in a corridor
or a doorway, but at the side of a room, in a corner, or at a dead end. Both robots know the ground and both positions,
so both find the same refuges for both of them, and agree who goes back: the one that has less far to go, and if both
have equally far, the one with the higher number. If that has not helped, the number alone decides.

A robot that goes on its way again treats the other one as an obstacle, so that it drives round it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from enum import Enum, auto
from typing import TYPE_CHECKING

import numpy as np

from agent.bodies.giveway import nearest
from agent.ports import Place, Stay
from agent.routes.ground import Ground
from agent.routes.routes import Routes
from patrol.ground.kernels.components import label_parts

if TYPE_CHECKING:
    from agent.routes.ground import Disc, Spot
    from agent.view import View

PATIENCE = 2
"""Number of bumps after which robots that cannot get past each other settle which of them goes back."""

CALM_S = 3.0
"""Bumps further apart than this do not add up, s."""

FARTHEST = 40.0
"""Longest way back, m."""

STILL_S = 4.0
"""After the other robot has stood still for so long, a robot goes on its own way again, s."""

STILL = 0.1
"""A robot stands still if it moves by less than this share of a stride in a tick."""

LONGEST_S = 60.0
"""Longest time for which a robot goes back and waits, s."""

AGAIN_S = 20.0
"""Two robots that block each other again within this time let their numbers decide, s."""

AROUND = 3
"""Thickness of the ground around a robot in a refuge that must hold together, points."""


class Part(Enum):
    """The part that a robot has when two have met where they cannot pass."""

    GOES_BACK = auto()
    GOES_FIRST = auto()


class Passing:
    """What one robot does about another that it cannot get past.

    Attributes:
        part: Its own; None while nothing is in its way.
    """

    def __init__(self, number: int, radii: Mapping[int, float], ground: Ground, step: float, stride: float) -> None:
        """Start with nobody in the way.

        Args:
            number: The robot's.
            radii: Radius in m of each robot of the fleet, by number.
            ground: Where the robot's centre may be.
            step: s per tick.
            stride: Longest way in one step, m.
        """
        self.part: Part | None = None
        self._number = number
        self._radii = radii
        self._ground = ground
        self._step = step
        self._stride = stride
        self._bumps = 0
        self._bumped_at = 0
        self._other = 0
        self._refuge: Spot = (0.0, 0.0)
        self._begun = 0
        self._settled: dict[int, int] = {}
        self._seen: Spot = (0.0, 0.0)
        self._moved_at = 0

    def lead(self, place: Place, view: View) -> Place | Stay:
        """Return where to go instead of a place, or the place itself where nobody is in the way.

        Args:
            place: Where the policy wants to be.
            view: Of this tick.
        """
        if view.bumped:
            calm = view.tick - self._bumped_at > CALM_S / self._step
            self._bumps = 1 if calm else self._bumps + 1
            self._bumped_at = view.tick
        if self.part is not None and self._is_over(view):
            self.part = None
        if view.bumped and self.part is not Part.GOES_BACK:
            self._settle(place, view)
        if self.part is None:
            return place
        if self.part is Part.GOES_BACK:
            if self._is_blocked(place, view):
                x, y = self._refuge
                return replace(place, x=x, y=y, bend=None, lean=None, wander=None, exact=True)
            self.part = Part.GOES_FIRST
        view.ground.close([self._disc(view, self._other)])
        return replace(place, bend=None, lean=None, wander=None)

    def _is_over(self, view: View) -> bool:
        """Return True if the other robot has gone, or has stood still for long."""
        if self._other not in view.peers or view.tick - self._begun > LONGEST_S / self._step:
            return True
        there, here = view.peers[self._other].pose, view.pose
        spot = there.x, there.y
        on_the_way = self.part is Part.GOES_BACK and math.dist((here.x, here.y), self._refuge) > self._stride
        if on_the_way or math.dist(spot, self._seen) > STILL * self._stride:
            self._moved_at = view.tick
        self._seen = spot
        if math.dist(spot, (here.x, here.y)) > self._wide(self._other) + FARTHEST:
            return True
        return view.tick - self._moved_at > STILL_S / self._step

    def _settle(self, place: Place, view: View) -> None:
        """Take a part if the nearest robot is in the way of a place."""
        gap, other = nearest(view.pose, view.peers, self._radii)
        if gap > self._radii[self._number] + 2.0 * self._stride:
            return
        self._other = other
        self._begun = self._moved_at = view.tick
        peer = view.peers[other].pose
        here, there = (view.reported.x, view.reported.y), (peer.x, peer.y)
        self._seen = there
        if not self._is_blocked(place, view):
            self.part = Part.GOES_FIRST if self._bumps >= PATIENCE else None
            return
        wide = self._wide(other)
        own, others = self._way_to_refuge(here, there, wide), self._way_to_refuge(there, here, wide)
        if own is None and others is None:
            return
        again = view.tick - self._settled.get(other, -math.inf) <= AGAIN_S / self._step
        self._settled[other] = view.tick
        if own is None or others is None:
            goes_back = others is None
        elif again or own[0] == others[0]:
            goes_back = self._number > other
        else:
            goes_back = own[0] < others[0]
        self.part = Part.GOES_BACK if goes_back else Part.GOES_FIRST
        if own is not None:
            self._refuge = own[1]

    def _is_blocked(self, place: Place, view: View) -> bool:
        """Return True if no way leads to a place round the other robot."""
        ground = self._closed([self._disc(view, self._other)])
        start = ground.join(view.pose.x, view.pose.y)
        if start is None:
            return True
        row, col = view.point_of((place.x, place.y))
        target = row + 1, col + 1
        return Routes(ground).way(start, target).place != ground.centre(*target)

    def _way_to_refuge(self, here: Spot, there: Spot, wide: float) -> tuple[float, Spot] | None:
        """Return the length of the way to the nearest refuge, and its place; None where there is none.

        Args:
            here: Of the robot that goes back, x and y in m.
            there: Of the one that it lets through.
            wide: Radii of both and half a point, m.
        """
        ground = self._closed([(*there, self._apart(here, there, wide))])
        point = ground.terrain.point
        lengths = Routes(ground).lengths(here, FARTHEST)
        every = max(1, round(0.25 * self._radii[self._number] / point))
        rows, cols = np.nonzero(np.isfinite(lengths[::every, ::every]))
        rows, cols = rows * every, cols * every
        for index in np.argsort(lengths[rows, cols], kind="stable"):
            row, col = int(rows[index]), int(cols[index])
            if self._is_refuge(row, col, wide / point + 1.0):
                return float(lengths[row, col]), ground.terrain.centre(row, col)
        return None

    def _is_refuge(self, row: int, col: int, wide: float) -> bool:
        """Return True if the ground around a disc on a point holds together.

        Args:
            row: Of the terrain.
            col: Of the terrain.
            wide: Radius of the disc, points.
        """
        reach = math.ceil(wide) + AROUND
        state = self._ground.static.open_now
        top, left = max(row - reach, 0), max(col - reach, 0)
        box = state[top : row + reach + 1, left : col + reach + 1]
        up, across = np.ogrid[top - row : top - row + box.shape[0], left - col : left - col + box.shape[1]]
        around = np.ascontiguousarray(box & (up**2 + across**2 >= wide**2)).view(np.uint8)
        labels, work = np.empty(around.shape, dtype=np.int32), np.empty(around.size, dtype=np.int32)
        return int(label_parts(around, labels, work)) == 1

    def _closed(self, discs: list[Disc]) -> Ground:
        """Return the ground with nothing closed but some discs."""
        static = self._ground.static
        ground = Ground(static.terrain, static.open_now, static)
        ground.begin(discs)
        return ground

    def _disc(self, view: View, other: int) -> Disc:
        peer = view.peers[other].pose
        there = peer.x, peer.y
        return *there, self._apart((view.pose.x, view.pose.y), there, self._wide(other))

    def _apart(self, here: Spot, there: Spot, wide: float) -> float:
        """Return the radius of a disc at another robot that does not cover the robot's own point, m."""
        return max(0.0, min(wide, math.dist(here, there) - self._ground.terrain.point))

    def _wide(self, other: int) -> float:
        return self._radii[other] + self._radii[self._number] + 0.5 * self._ground.terrain.point
