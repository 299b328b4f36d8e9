"""Obstacles that one robot believes in its way although no sensor shows them.

Theory of operation
    The body of a robot that has died stays where it is until it is removed, and others have no sensor for it. So a
    robot that was not heard for a while is an obstacle where it should have stopped, which is a step after its last
    position. After a limited time the place counts as free until this robot bumps there, and after each such bump it
    is closed for longer.

    A bump that no robot heard explains shows that something is there, whatever it is. It lies within reach of the
    cancelled move, and no nearer to this robot than the bodies allow. A silent robot near by is moved to where that
    holds. Where there is none, and no wall, the contact becomes an obstacle. So each bump mends a wrong place.

    A robot that is heard late may be elsewhere by now. After a bump into it, it is taken to be there until it tells of
    a later place.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from patrol.ground.swept_path import line_is_free
from patrol.pose import Pose

if TYPE_CHECKING:
    from agent.belief.believed import Belief
    from agent.routes.ground import Disc, Spot
    from patrol.ground.terrain import Terrain
    from patrol.radio.inbox import Peers
    from patrol.radio.peers import Peer


BUMPED_S = 20.0
"""Time for which ground is closed after a bump into something that is not known, s."""

MOST_SPELLS = 8
"""Longest closure after a bump, as a multiple of the first one around a silent robot."""

OFF_STRIDES = 2.0
"""Largest distance of a silent robot from where it should have stopped, in its strides: it may have turned."""

HEARD_M = 0.02
"""Largest error of the distance between two robots that hear each other's positions to the centimetre, m."""


@dataclass(slots=True)
class Obstacle:
    """Something in the way of one robot."""

    place: Spot
    reach: float  # the nearest to it that the robot's centre gets, m
    until: int  # tick up to which its ground is closed
    spell: int  # for how many ticks it is, from a bump on
    is_met: bool = True  # this robot has bumped into it


class Obstacles:
    """The obstacles of one robot. Call `note` once a tick before all else."""

    def __init__(
        self,
        number: int,
        radii: Mapping[int, float],
        strides: Mapping[int, float],
        terrain: Terrain,
        patience: int,
        memory: int,
        first: int,
    ) -> None:
        """Begin with nothing in the way; `radii` and `strides` are in m, by number, and times in ticks.

        A robot unheard for more than `patience` counts as silent; its ground is closed until `memory` after it was last
        heard or bumped into, and that of anything else for `first` after a bump. Each bump after that time doubles it.
        """
        self._radius, self._radii = radii[number], radii
        # As if it were as large as the robot itself.
        self._unknown_reach = 2.0 * radii[number]
        self._strides = strides
        self._terrain = terrain
        self._patience = patience
        self._memory = memory
        self._first = first
        self._heard_since = 0
        self._known: dict[int, Obstacle] = {}  # by number of the robot; below 0 where it is not known
        self._met: dict[int, tuple[int, Pose]] = {}  # when and where the robot bumped into one that is heard late

    def note(
        self,
        tick: int,
        pose: Pose,
        end: Pose | None,
        belief: Belief,
        peers: Mapping[int, Peer],
        elsewhere: Collection[int] = (),
    ) -> list[Disc]:
        """Take in a tick; return the discs into which the robot's centre does not get.

        `end` is where a cancelled move should have led, None without a bump. `peers` are where other robots should be
        by now. Those of the numbers `elsewhere` have gone on, unheard.
        """
        others, known, longest = belief.peers, self._known, MOST_SPELLS * self._memory
        for number in self._find_silent(tick, others):
            if number not in known and number not in elsewhere:
                known[number] = self._place_silent(number, belief, others[number].tick + self._memory)
        # A copy, since entries are removed on the way.
        for number, obstacle in list(known.items()):
            # It is heard again, or was not met for long.
            is_gone = others[number].tick == tick if number > 0 else tick > obstacle.until + longest
            if is_gone or (number in elsewhere and not obstacle.is_met):
                del known[number]
        if end is not None and not self._meet(tick, pose, end, peers):
            self._learn(tick, pose, end, belief)
        here = pose.x, pose.y
        for obstacle in known.values():
            if math.dist(here, obstacle.place) < obstacle.reach:
                obstacle.place = _at_distance(here, obstacle.place, obstacle.reach)
        return [(*obstacle.place, obstacle.reach) for obstacle in known.values() if tick <= obstacle.until]

    def met(self, tick: int, heard: Mapping[int, Peer]) -> dict[tuple[int, int], Disc]:
        """Return the discs that are closed because the robot has bumped into a silent one there.

        They are by that one's number and the tick up to which it is closed, which change only with another bump.
        `heard` has when each was heard last: one of which a frame or two are missing is not silent.
        """
        return {
            (number, obstacle.until): (*obstacle.place, obstacle.reach)
            for number, obstacle in self._known.items()
            if number > 0 and obstacle.is_met and tick <= obstacle.until and tick - heard[number].tick > self._patience
        }

    def closed(self, discs: Iterable[Disc], pose: Pose) -> list[Disc]:
        """Return the discs to close because of some of `note`: half a point wider, but not over the robot's point."""
        here = self._terrain.centre(*self._terrain.nearest_point(pose.x, pose.y))
        return [(x, y, min(reach + 0.5 * self._terrain.point, math.dist(here, (x, y)))) for x, y, reach in discs]

    def corrected(self, peers: Mapping[int, Peer]) -> Mapping[int, Peer]:
        """Return robots where they should be by now: where each was bumped into, until it tells of a later place."""
        self._met = {number: (tick, at) for number, (tick, at) in self._met.items() if peers[number].sequence < tick}
        if not self._met:
            return peers
        return {**peers, **{number: replace(peers[number], pose=at) for number, (_, at) in self._met.items()}}

    def _find_silent(self, tick: int, heard: Peers) -> Iterable[int]:
        if tick - self._heard_since <= self._patience:
            return ()
        # A robot that is heard again, or for the first time, is heard later than now.
        self._heard_since = heard.oldest(tick)
        return heard.silent(tick - self._patience) if tick - self._heard_since > self._patience else ()

    def _reach(self, number: int) -> float:
        """Return how near another robot's centre gets to this one's, m."""
        return self._radius + self._radii[number]

    def _place_silent(self, number: int, belief: Belief, until: int) -> Obstacle:
        spot = belief.stopped(number)
        return Obstacle((spot.x, spot.y), self._reach(number), until, self._memory, is_met=False)

    def _meet(self, tick: int, pose: Pose, end: Pose, peers: Mapping[int, Peer]) -> bool:
        """Return True if a bump was into a robot that is heard; note where that is if it is heard late."""
        gaps = []
        for number, peer in peers.items():
            late, reach = tick - peer.sequence, self._reach(number) + HEARD_M
            # A step of its own may have been cancelled as well.
            gap = _distance_from(pose, end, (peer.pose.x, peer.pose.y)) - reach - (late + 1) * self._strides[number]
            if peer.tick == tick and gap <= 0.0:
                # Robots heard in time come first, then the nearest, then the lowest number.
                gaps.append((late > 0, gap, number))
        if not gaps:
            return False
        is_late, _, number = min(gaps)
        if is_late:
            spot = _find_contact(pose, end, self._reach(number))
            self._met[number] = tick, Pose(*spot, peers[number].pose.heading)
        return True

    def _learn(self, tick: int, pose: Pose, end: Pose, belief: Belief) -> None:
        """Learn from a bump that no robot heard explains."""
        if (end.x, end.y) == (pose.x, pose.y):
            return  # it stood, and something drove into it
        near = dict(self._known)
        for number, peer in belief.peers.items():
            if number not in near and peer.tick < tick:
                near[number] = self._place_silent(number, belief, tick)
        gaps = {
            other: _distance_from(pose, end, there.place) - there.reach
            for other, there in near.items()
            # A move away from what was met is not cancelled by it.
            if not (there.is_met and _nearest_on(pose, end, there.place) == (pose.x, pose.y))
        }
        fits = [other for other in gaps if gaps[other] <= (OFF_STRIDES * self._strides[other] if other > 0 else 0.0)]
        number = min(fits, key=lambda other: (gaps[other], other), default=min([0, *self._known]) - 1)
        if number not in near:
            # It may have been a wall, where the robot is not quite where it takes itself to be.
            if not line_is_free(self._terrain, (pose.x, pose.y), (end.x, end.y), self._unknown_reach):
                return
            contact = _find_contact(pose, end, self._unknown_reach)
            near[number] = Obstacle(contact, self._unknown_reach, tick, self._first)
        obstacle = self._known[number] = near[number]
        obstacle.is_met = True
        if tick > obstacle.until:
            obstacle.spell = min(2 * obstacle.spell, MOST_SPELLS * self._memory)
        obstacle.until = tick + obstacle.spell
        # Contact came about half-way.
        middle = Pose(0.5 * (pose.x + end.x), 0.5 * (pose.y + end.y), pose.heading)
        if _distance_from(pose, middle, obstacle.place) > obstacle.reach:
            obstacle.place = _at_distance(_nearest_on(pose, middle, obstacle.place), obstacle.place, obstacle.reach)


def _find_contact(pose: Pose, end: Pose, reach: float) -> Spot:
    """Return about where something is that has cancelled a move, by how near to it the robot's centre gets, m.

    For example, (1.25, 0) for a move from (0, 0) to (0.5, 0) that was cancelled with a reach of 1 m: contact came half-
    way.
    """
    way = math.dist((pose.x, pose.y), (end.x, end.y))
    return _at_distance((pose.x, pose.y), (end.x, end.y), reach + 0.5 * way)


def _at_distance(centre: Spot, place: Spot, distance: float) -> Spot:
    """Return the place in the same direction from a centre at a distance, m; the centre if they are the same.

    For example, (6, 8) for the centre (0, 0), the place (3, 4) and 10 m.
    """
    share = distance / (math.dist(centre, place) or 1.0)
    return centre[0] + share * (place[0] - centre[0]), centre[1] + share * (place[1] - centre[1])


def _distance_from(start: Pose, end: Pose, place: Spot) -> float:
    """Return the distance of a place from the straight line between two poses, m."""
    return math.dist(_nearest_on(start, end, place), place)


def _nearest_on(start: Pose, end: Pose, place: Spot) -> Spot:
    """Return the place on the straight line between two poses that is nearest to another place.

    For example, (2, 0) for the line from (0, 0) to (2, 0) and the place (3, 1): the line ends there.
    """
    across, up = end.x - start.x, end.y - start.y
    along = (place[0] - start.x) * across + (place[1] - start.y) * up
    share = min(max(along / (across**2 + up**2 or 1.0), 0.0), 1.0)
    return start.x + share * across, start.y + share * up
