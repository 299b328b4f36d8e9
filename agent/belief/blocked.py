"""Ground that is believed blocked: places that could not be reached, and the last poses of robots not heard any more.

Theory of operation
    The belief is that of one robot. It stays there, because positions are all that robots exchange. A point is
    believed blocked from when the robot sees it blocked or bumps into it, until it sees it free, or until it has not
    seen it for `memory` ticks. The robot's sensor is computed on the map without these points
    (`patrol.closures.ground`). A point that this view shows, and that the robot's senses do not report, is free.

    For its ways the robot leaves out all points nearer to blocked ones than its planning radius. What it can reach then
    is the part of the ground that it stands in. Where it stands to see each point is found anew for this part
    (`patrol.ground.fields.proxies_of`). What it cannot see from there is *left out* of the fog that its policy sees,
    until the belief changes.

The body of a robot that has died stays where it is until it is removed, and others have no sensor for it. So a robot
that was not heard for a while is an obstacle where it should have stopped, for a limited time. Then the place counts as
free until this robot bumps there, and is closed for longer after each bump. So is whatever else the robot bumps into.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agent.routes.ground import Area, Disc
from patrol.closures.ground import ChangingFootprint, faces
from patrol.exchange import MOST_BLOCKED
from patrol.ground.cspace import clearance_levels, needed_level, parts_of
from patrol.ground.fields import StaticFields, proxies_of
from patrol.pose import Pose
from patrol.radio.inbox import Peers
from patrol.radio.message import as_received

if TYPE_CHECKING:
    from agent.belief.believed import Belief
    from agent.belief.dilated import Posts
    from agent.routes.ground import Spot
    from patrol.exchange import Sensed
    from patrol.ground.terrain import BoolGrid, Terrain
    from patrol.radio.peers import Peer


UNSEEN = -1

BUMPED_S = 20.0
"""Time for which ground is closed after a bump into something that is not known, s."""

MOST_SPELLS = 8
"""Longest time for which ground is closed after a bump, in times for which that of a silent robot is at first."""

OFF_STRIDES = 2.0
"""Largest distance of a silent robot from where it should have stopped, in its strides: it may have turned."""

HEARD_M = 0.02
"""Largest error of the distance between two robots that hear each other's positions to the centimetre, m."""


class Blocked:
    """The points that one robot believes blocked.

    `grid`, bool (h, w), has the points, and `area` is where the robot's centre may not be because of them. `left_out`,
    bool (h, w), has the patrolled points that it cannot get to see. `stands`, int64 (h w,), is the flat index of where
    to stand to see each point, -1 for nowhere. All but `grid` are None while nothing is believed blocked.
    """

    def __init__(
        self, footprint: ChangingFootprint, fields: StaticFields, radius: float, memory: int, posts: Posts | None = None
    ) -> None:
        """Begin with nothing blocked.

        `footprint` is the robot's sensor on the ground as it believes it. It is kept up to date with the belief, and so
        are `posts`, where the policy stands to see points. A blocked point that is not seen is forgotten after `memory`
        ticks. `radius` is in m.
        """
        self._posts = posts
        self._footprint = footprint
        self._fields = fields
        self._level = needed_level(radius, footprint.terrain.point)
        self._margin = int(np.ceil(np.sqrt(self._level))) // 2 + 2
        self._memory = memory
        self._seen_at: NDArray[np.int32] = np.full(footprint.terrain.shape, UNSEEN, dtype=np.int32)
        self.grid: BoolGrid = np.zeros(footprint.terrain.shape, dtype=np.bool_)
        self.area: Area | None = None
        self.left_out: BoolGrid | None = None
        self.stands: NDArray[np.int64] | None = None
        self._parts: NDArray[np.int32] | None = None
        self._part = 0

    def sense(self, sensed: Sensed) -> None:
        """Take in the robot's senses, before it looks around."""
        if not sensed.blocked and self.area is None:
            return
        seen_at = self._seen_at.reshape(-1)
        blocked = np.array(sensed.blocked, dtype=np.int64)
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

    def stand_at(self, point: tuple[int, int] | None) -> None:
        """Bring `left_out` up to date with the part of the ground in which the robot stands.

        `point` is the (row, column) on which it stands or which it joins; None for a robot that is off the ground.
        """
        if self.area is None or point is None:
            return
        if self._parts is None:
            open_now = self._fields.reach.copy()
            top, bottom, left, right = self.area.box
            open_now[top - 1 : bottom - 1, left - 1 : right - 1] &= ~self.area.mask
            self._parts, _ = parts_of(open_now)
            self._part = 0
        part = int(self._parts[point])
        if part in (0, self._part):
            return
        self._part = part
        reached = self._parts == part
        terrain = self._footprint.terrain
        proxy = proxies_of(terrain, reached, self._footprint.range_m, self._footprint.line_of_sight)
        proxy[~self._fields.patrolled] = -1
        self.left_out = self._fields.patrolled & ~reached & (proxy < 0)
        self.stands = np.where(reached, np.arange(reached.size).reshape(reached.shape), proxy).reshape(-1)
        if self._posts is not None:
            self._posts.move(proxy)

    def _note_change(self) -> None:
        self._parts = None
        if not self.grid.any():
            self.area = self.left_out = self.stands = None
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


@dataclass(slots=True)
class Obstacle:
    """Something in the way of one robot that none of its sensors shows."""

    x: float  # m, as is y
    y: float
    reach: float  # the nearest to it that the robot's centre gets, m
    until: int  # tick up to which its ground is closed
    spell: int  # for how many ticks it is, from a bump on


class Obstacles:
    """What one robot believes in its way: robots that it no longer hears, and what it has bumped into.

    A robot that falls silent has made one more step since its last position. A bump that no robot heard explains shows
    more: what is there lies within reach of the cancelled move, and not nearer to the robot than the bodies allow.
    """

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
        """Begin with nothing in the way; `radii` and `strides` are in m, by number, and all others in ticks.

        A robot unheard for more than `patience` counts as silent; its ground is closed until `memory` after it was last
        heard or bumped into, and that of anything else for `first` after a bump. Each bump after that time doubles it.
        """
        self._number = number
        self._radii = radii
        self._strides = strides
        self._terrain = terrain
        self._patience = patience
        self._memory = memory
        self._first = first
        self._heard_since = 0
        self._known: dict[int, Obstacle] = {}  # by number of the robot; below 0 where it is not known
        self._met: dict[int, tuple[int, Pose]] = {}  # when and where the robot bumped into one that is heard late

    def note(self, tick: int, pose: Pose, end: Pose | None, belief: Belief, peers: Mapping[int, Peer]) -> list[Disc]:
        """Take in a tick; return the discs that the robot's centre keeps out of, as its body cannot get in.

        `end` is where a cancelled move should have led, None without a bump. `peers` are where other robots should be
        by now.
        """
        heard, known = belief.peers, self._known
        for number in self._find_silent(tick, heard):
            if number not in known:
                known[number] = self._place_silent(number, belief, heard[number].tick + self._memory)
        for number in [number for number, obstacle in known.items() if self._is_over(tick, number, obstacle, heard)]:
            del known[number]
        if end is not None and not self._meet(tick, pose, end, peers):
            self._learn(tick, pose, end, belief)
        for obstacle in known.values():
            self._keep_off(obstacle, pose)
        return [(obstacle.x, obstacle.y, obstacle.reach) for obstacle in known.values() if tick <= obstacle.until]

    def closed(self, discs: Iterable[Disc], pose: Pose) -> list[Disc]:
        """Return the discs to close because of some of `note`: half a point wider, but not over the robot's point."""
        here = self._terrain.centre(*self._terrain.nearest_point(pose.x, pose.y))
        return [(x, y, min(reach + 0.5 * self._terrain.point, math.dist(here, (x, y)))) for x, y, reach in discs]

    def _find_silent(self, tick: int, heard: Peers) -> Iterable[int]:
        if tick - self._heard_since <= self._patience:
            return ()
        # A robot that is heard again, or for the first time, is heard later than now.
        self._heard_since = heard.oldest(tick)
        return heard.silent(tick - self._patience) if tick - self._heard_since > self._patience else ()

    def _is_over(self, tick: int, number: int, obstacle: Obstacle, heard: Peers) -> bool:
        """Return True for a robot that is heard again, and for something that was not met again for long."""
        return heard[number].tick == tick if number > 0 else tick > obstacle.until + MOST_SPELLS * self._memory

    def _place_silent(self, number: int, belief: Belief, until: int) -> Obstacle:
        spot = belief.stopped(number)
        return Obstacle(spot.x, spot.y, self._radii[self._number] + self._radii[number], until, self._memory)

    def _meet(self, tick: int, pose: Pose, end: Pose, peers: Mapping[int, Peer]) -> bool:
        """Return True if a bump was into a robot that is heard; note where that is if it is heard late."""
        gaps = {}
        for number, peer in peers.items():
            late, (x, y) = tick - peer.sequence, (peer.pose.x, peer.pose.y)
            reach = self._radii[self._number] + self._radii[number] + late * self._strides[number] + HEARD_M
            gap = math.dist(_nearest_on(pose, end, x, y), (x, y)) - reach
            if peer.tick == tick and gap <= 0.0:
                gaps[number] = gap
        if not gaps:
            return False
        number = min(gaps, key=lambda number: (peers[number].sequence < tick, gaps[number], number))
        if peers[number].sequence < tick:
            x, y = _find_contact(pose, end, self._radii[self._number] + self._radii[number])
            self._met[number] = tick, Pose(x, y, peers[number].pose.heading)
        return True

    def corrected(self, peers: Mapping[int, Peer]) -> Mapping[int, Peer]:
        """Return the robots where they should be by now: where each was bumped into, until it tells of a later one."""
        self._met = {number: (tick, at) for number, (tick, at) in self._met.items() if peers[number].sequence < tick}
        if not self._met:
            return peers
        return {**peers, **{number: replace(peers[number], pose=at) for number, (_, at) in self._met.items()}}

    def _learn(self, tick: int, pose: Pose, end: Pose, belief: Belief) -> None:
        """Learn from a bump that no robot heard explains."""
        near = dict(self._known)
        for number, peer in belief.peers.items():
            if number not in near and peer.tick < tick:
                near[number] = self._place_silent(number, belief, tick)
        gaps = {
            other: math.dist(_nearest_on(pose, end, there.x, there.y), (there.x, there.y)) - there.reach
            for other, there in sorted(near.items())
        }
        fits = [other for other in gaps if gaps[other] <= (OFF_STRIDES * self._strides[other] if other > 0 else 0.0)]
        number = min(fits, key=lambda other: gaps[other], default=min([0, *self._known]) - 1)
        if number not in near:
            radius = 2.0 * self._radii[self._number]  # as if it were as large as the robot itself
            near[number] = Obstacle(*_find_contact(pose, end, radius), radius, tick, self._first)
        obstacle = self._known[number] = near[number]
        if tick > obstacle.until:
            obstacle.spell = min(2 * obstacle.spell, MOST_SPELLS * self._memory)
        obstacle.until = tick + obstacle.spell
        if gaps.get(number, 0.0) > 0.0:
            x, y = _nearest_on(pose, end, obstacle.x, obstacle.y)
            share = obstacle.reach / (obstacle.reach + gaps[number])
            obstacle.x, obstacle.y = x + share * (obstacle.x - x), y + share * (obstacle.y - y)

    def _keep_off(self, obstacle: Obstacle, pose: Pose) -> None:
        """Move an obstacle off the robot, which stands where it stands."""
        x, y = obstacle.x - pose.x, obstacle.y - pose.y
        apart = math.hypot(x, y)
        if 0.0 < apart < obstacle.reach:
            share = obstacle.reach / apart
            obstacle.x, obstacle.y = pose.x + share * x, pose.y + share * y


def _find_contact(pose: Pose, end: Pose, reach: float) -> Spot:
    """Return about where something is that has cancelled a move, by how near to it the robot's centre gets, m."""
    way = math.dist((pose.x, pose.y), (end.x, end.y))
    ahead = math.atan2(end.y - pose.y, end.x - pose.x) if way > 0.0 else pose.heading
    off = reach + 0.5 * way
    return pose.x + off * math.cos(ahead), pose.y + off * math.sin(ahead)


def _nearest_on(start: Pose, end: Pose, x: float, y: float) -> Spot:
    """Return the place on the straight line between two poses that is nearest to a place."""
    across, up = end.x - start.x, end.y - start.y
    length = across**2 + up**2
    share = min(max(((x - start.x) * across + (y - start.y) * up) / length, 0.0), 1.0) if length > 0.0 else 0.0
    return start.x + share * across, start.y + share * up
