"""Passing in narrow places: which of two robots that block each other goes back, and how far, from positions alone.

In a corridor that is too narrow for two, giving way does not help: there is no way round the other robot. One of the
two has to go back to where the other can get past it, and wait there:

      +------+              +------+
      |      +--------------+      |        1 and 2 have met in the corridor. 2 has less far to go back to a place
      |              1 > < 2     R |        where it blocks no other robot (R), so it goes there. 1 follows it, and
      |      +--------------+      |        drives past it as soon as there is room.
      +------+              +------+

A place is a *refuge* where a robot that stands there parts the ground around it into no two pieces: not in a corridor
or a doorway, but at the side of a room, in a corner, or at a dead end. Both robots know the ground and both positions,
so both find nearly the same refuges for both of them, and mostly agree which one goes back: the one that has less far
to go, and if both have equally far, the one with the higher number. If that has not helped, the number alone decides.
Where they disagree, they bump again, or both stand still, and settle anew.

A robot that goes on its way again treats the other one as an obstacle, so that it drives round it. Only two robots are
considered: a third one that stands behind the one that goes back is not.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from enum import Enum, auto
from typing import TYPE_CHECKING

import numpy as np

from agent.bodies.giveway import Bumps, disc_round, nearest
from agent.ports import Intent, Place
from agent.routes.ground import Ground
from agent.routes.routes import Routes
from patrol.kernels.components import label_parts

if TYPE_CHECKING:
    from agent.routes.ground import Disc, Spot
    from agent.view import View
    from patrol.pose import Pose
    from patrol.radio.peers import Peer

PATIENCE = 2
"""Number of bumps after which a robot drives round another that it could get past."""

CALM_S = 3.0
"""Bumps further apart than this do not add up, s."""

FARTHEST = 40.0
"""Longest way back, m."""

STILL_S = 4.0
"""After the other robot has stood still for so long, a robot goes on its own way again, s."""

STILL = 0.1
"""A robot stands still if it moves by less than this share of a stride in a tick."""

LONGEST_S = 60.0
"""Longest time without a new bump for which a robot goes back or goes first, s."""

AGAIN_S = 20.0
"""Two robots that block each other again within this time let their numbers decide, s."""

PAST = 4.0
"""A robot that goes first has got past the other once they are so many strides apart, besides their bodies."""

AROUND = 3
"""Thickness of the ground around a robot in a refuge that must hold together, points."""


class Role(Enum):
    """The task of one of two robots that have met where they cannot pass."""

    GOES_BACK = auto()
    GOES_FIRST = auto()


class Passing:
    """One robot's way of dealing with another that it cannot get past.

    `role` is None while no other robot blocks it.
    """

    def __init__(self, number: int, radii: Mapping[int, float], ground: Ground, step: float, stride: float) -> None:
        """Start with no robot in the way; radii and `stride` are in m, `step` is in s per tick."""
        self.role: Role | None = None
        self._number = number
        self._radii = radii
        self._ground = ground
        self._step = step
        self._stride = stride
        self._bumps = Bumps(CALM_S / step)
        self._place: Place | None = None
        self._other = 0
        self._refuge: Spot = (0.0, 0.0)
        self._begun = 0
        self._settled: dict[int, int] = {}
        self._hopeless: dict[int, int] = {}
        self._expected: int | None = None
        self._seen: Spot = (0.0, 0.0)
        self._moved_at = 0

    def blocker(self, pose: Pose, peers: Mapping[int, Peer]) -> int | None:
        """Return the number of a robot so near that the two collide, if it leaves no way round it to the last place."""
        if self._place is None:
            return None
        other = self._in_reach(pose, peers)
        return other if other is not None and self._is_blocked(self._place, pose, peers[other].pose, other) else None

    def lead(self, intent: Intent, view: View) -> Intent:
        """Return where to go instead of a place, or the intent itself where no robot is in the way."""
        self._place = place = intent if isinstance(intent, Place) and view.start is not None else None
        if place is None:
            return intent
        if view.bumped:
            self._bumps.add(view.tick)
        if self.role is not None and self._is_over(view):
            self.role = None
        if view.bumped and self.role is not Role.GOES_BACK:
            self._settle(place, view, self._in_reach(view.pose, view.peers))
        return self._act(place, view)

    def meet(self, place: Place, other: int, view: View) -> Place:
        """Settle with a robot that comes towards this one where they cannot pass, and return where to go."""
        self._settle(place, view, other)
        return self._act(place, view)

    def _act(self, place: Place, view: View) -> Place:
        """Return where to go in the role that the robot has."""
        if self.role is None:
            return place
        if self.role is Role.GOES_BACK:
            if self._is_blocked(place, view.pose, view.peers[self._other].pose, self._other):
                x, y = self._refuge
                return replace(place, x=x, y=y, bend=None, lean=None, wander=None, exact=True)
            self.role = Role.GOES_FIRST
        view.ground.close([self._disc(view.pose, view.peers[self._other].pose, self._other)])
        return replace(place, bend=None, lean=None, wander=None)

    def _is_over(self, view: View) -> bool:
        """Return True if the other robot has gone, or has stood still for long."""
        if self._other not in view.peers or view.tick - self._begun > LONGEST_S / self._step:
            return True
        there, here = view.peers[self._other].pose, view.pose
        spot = there.x, there.y
        on_the_way = self.role is Role.GOES_BACK and math.dist((here.x, here.y), self._refuge) > self._stride
        if on_the_way or math.dist(spot, self._seen) > STILL * self._stride:
            self._moved_at = view.tick
        self._seen = spot
        farthest = FARTHEST if self.role is Role.GOES_BACK else PAST * self._stride
        if math.dist(spot, (here.x, here.y)) > self._both(self._other) + 0.5 * self._ground.terrain.point + farthest:
            return True
        return view.tick - self._moved_at > STILL_S / self._step

    def _settle(self, place: Place, view: View, other: int | None) -> None:
        """Take a role if another robot blocks the way to a place."""
        if other is None:
            return
        peer = view.peers[other].pose
        here, there = (view.reported.x, view.reported.y), (peer.x, peer.y)
        refuge = self._refuge
        if not self._is_blocked(place, view.pose, peer, other):
            role = Role.GOES_FIRST if self._bumps.count >= PATIENCE else None
        else:
            lately = view.tick - self._settled.get(other, -math.inf) <= AGAIN_S / self._step
            hopeless = view.tick - self._hopeless.get(other, -math.inf) <= AGAIN_S / self._step
            if hopeless:
                return
            both = self._both(other)
            own, others = self._way_to_refuge(here, there, both), self._way_to_refuge(there, here, both)
            self._settled[other] = view.tick
            if own is None and others is None:
                role, self._hopeless[other] = None, view.tick
            elif own is None or others is None:
                role = Role.GOES_BACK if others is None else Role.GOES_FIRST
            elif lately or own[0] == others[0]:
                role = Role.GOES_BACK if self._number > other else Role.GOES_FIRST
            else:
                role = Role.GOES_BACK if own[0] < others[0] else Role.GOES_FIRST
            refuge = own[1] if own is not None else refuge
        self.role, self._refuge, self._other, self._seen = role, refuge, other, there
        self._begun = self._moved_at = view.tick

    def _in_reach(self, pose: Pose, peers: Mapping[int, Peer]) -> int | None:
        """Return the number of the nearest robot if two strides lead into it."""
        gap, other = nearest(pose, peers, self._radii)
        return other if gap <= self._radii[self._number] + 2.0 * self._stride else None

    def _is_blocked(self, place: Place, pose: Pose, there: Pose, other: int) -> bool:
        """Return True if no way leads to a place round another robot."""
        row, col = self._ground.terrain.nearest_point(place.x, place.y)
        if not self._ground.static.open_now[row, col]:
            return False
        ground = self._closed([self._disc(pose, there, other)])
        start = ground.join(pose.x, pose.y)
        if start is None:
            return True
        target = row + 1, col + 1
        way = Routes(ground).way(start, target, self._expected)
        self._expected = round(100.0 * (way.length + 2.0 * self._stride) / ground.terrain.point)
        return way.place != ground.centre(*target)

    def _way_to_refuge(self, here: Spot, there: Spot, both: float) -> tuple[float, Spot] | None:
        """Return the length of the way to the nearest refuge, m, and its place; None where there is none.

        `here` is the robot that goes back, `there` the one that it lets through; `both` is the sum of their radii, m.
        """
        point = self._ground.terrain.point
        ground = self._closed([disc_round(there, here, both, point)])
        lengths = Routes(ground).lengths(here, FARTHEST)
        rows, cols = np.nonzero(np.isfinite(lengths))
        order = np.argsort(lengths[rows, cols], kind="stable")
        rows, cols = rows[order], cols[order]
        # The nearest place of each square of a quarter of a radius stands for the square.
        side = max(1, round(0.25 * self._radii[self._number] / point))
        _, nearest_ones = np.unique(rows // side * lengths.shape[1] + cols // side, return_index=True)
        for index in np.sort(nearest_ones):
            row, col = int(rows[index]), int(cols[index])
            if self._is_refuge(row, col, both / point + 1.5):
                return float(lengths[row, col]), ground.terrain.centre(row, col)
        return None

    def _is_refuge(self, row: int, col: int, wide: float) -> bool:
        """Return True if a disc on a point leaves the ground around it in one piece.

        Only ground that hangs together with the point counts. `wide` is the radius of the disc in points.
        """
        reach = math.ceil(wide) + AROUND
        state = self._ground.static.open_now
        top, left = max(row - reach, 0), max(col - reach, 0)
        box = np.ascontiguousarray(state[top : row + reach + 1, left : col + reach + 1]).view(np.uint8)
        up, across = np.ogrid[top - row : top - row + box.shape[0], left - col : left - col + box.shape[1]]
        labels, work = np.empty(box.shape, dtype=np.int32), np.empty(box.size, dtype=np.int32)
        label_parts(box, labels, work)
        own = labels == labels[row - top, col - left]
        around = np.ascontiguousarray(own & (up**2 + across**2 >= wide**2)).view(np.uint8)
        return int(label_parts(around, labels, work)) == 1

    def _closed(self, discs: list[Disc]) -> Ground:
        """Return the ground with nothing closed but some discs."""
        static = self._ground.static
        ground = Ground(static.terrain, static.open_now, static)
        ground.begin(discs)
        return ground

    def _disc(self, here: Pose, there: Pose, other: int) -> Disc:
        return disc_round((there.x, there.y), (here.x, here.y), self._both(other), self._ground.terrain.point)

    def _both(self, other: int) -> float:
        """Return the radii of this robot and another together, m."""
        return self._radii[other] + self._radii[self._number]
