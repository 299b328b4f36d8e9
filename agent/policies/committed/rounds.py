"""Following a round: always on to the first place from which something stale is to be seen.

A robot on a round keeps a *cursor*, the place of the tour that it has come to. Its next target is the first point after
the cursor that is stale, and it drives to the place to which that point belongs, the shortest way. So it cuts
corners where nothing is left to see, leaves out what another robot has just seen, and misses nothing.

A point is stale once it has been unseen for half of the time between two robots of an evenly spaced round; one that the
round visits several times, for half of the time between two visits. Where
nothing is stale within one sensor range, or four strides, along the tour, the robot drives that far along.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from agent.policies.commitment.stands import RoundStands

if TYPE_CHECKING:
    from agent.policies.commitment.given_up import GivenUp
    from agent.ports import PolicySetup
    from agent.view import View
    from patrol.ground.tour.round import Flat, Round

STALE = 0.5
"""Share of the time between two robots of an evenly spaced round after which a point is stale."""

AHEAD = 1.0
"""Length of the tour on which the next target is looked for, in sensor ranges."""

AHEAD_STRIDES = 4.0
"""The same in strides at least, so that a robot whose sensor sees no farther than it drives need not slow down."""

OVERDUE, NEAR = 3.0, 2.0
"""A point whose place on the tour cannot be got to is gone to after so many times between two robots, where the way is
no longer than so many times the length on which targets are looked for."""

Point = tuple[int, int]
"""Row and column of the terrain."""


class Stop(NamedTuple):
    """The next stop on a round."""

    point: Point  # to be seen; that of the place itself where nothing is stale
    stand: Point  # where to see it from
    age: int  # of the point, ticks; 0 where nothing is stale
    place: int  # number among the round's places


class RoundAhead:
    """The part of a round that lies ahead of one robot."""

    def __init__(self, setup: PolicySetup, laid_out: Round) -> None:
        self.round = laid_out
        self.cursor: int | None = None  # number of the place that the robot has come to; None before it has begun
        self._width = setup.terrain.width
        self._step = setup.step
        self._speed = setup.spec.speed
        self._ahead_m = max(AHEAD * setup.sight.range_m, AHEAD_STRIDES * setup.spec.speed * setup.step)
        self._firsts = np.searchsorted(laid_out.place_of, np.arange(len(laid_out.places) + 1))
        self._stands = RoundStands(setup, laid_out)
        _, index, times = np.unique(laid_out.points, return_inverse=True, return_counts=True)
        self._times = times[index]

    def interval(self, team: float) -> float:
        """Return the time between two robots of an evenly spaced round, ticks."""
        return self.round.length_m / (team * self._speed * self._step)

    def go_to(self, along_m: float) -> None:
        """Put the cursor to the place at a length along the tour, m."""
        self.cursor = int(np.searchsorted(self.round.along, along_m)) % len(self.round.places)

    def come_to(self, along_m: float) -> None:
        """Move the cursor on with the robot, m along the tour; not farther than stops are looked for."""
        if self.cursor is None or (along_m - self.round.along[self.cursor]) % self.round.length_m < self._ahead_m:
            self.go_to(along_m)

    def next(self, view: View, team: int, given_up: GivenUp) -> Stop:
        """Return the next stop of a robot on a round of ``team`` robots."""
        cursor = self._reachable(view, self.cursor or 0)
        end = float(self.round.along[cursor]) + self._ahead_m
        last = int(np.searchsorted(self.round.along, end))
        stretches = [(cursor, last)]
        if end > self.round.length_m:
            stretches.append((0, min(int(np.searchsorted(self.round.along, end - self.round.length_m)), cursor)))
        least = max(1.0, min(STALE * self.interval(team), 0.5 * view.mfow))
        overdue = max(least, OVERDUE * self.interval(team))
        if view.fog.stands is not None and (stop := self._orphan(view, cursor, overdue, view.fog.stands)) is not None:
            return stop
        for first, until in stretches:
            if (stop := self._first(view, first, until, least, given_up)) is not None:
                return stop
        place = self._reachable(view, stretches[-1][1] % len(self.round.places))
        spot = divmod(int(self.round.places[place]), self._width)
        return Stop(spot, spot, 0, place)

    def _reachable(self, view: View, place: int) -> int:
        """Return the first place that the robot gets to, from ``place`` on; ``place`` where there is none."""
        if view.fog.stands is None:
            return place
        reached = view.fog.stands[self.round.places] == self.round.places
        return (place + int(np.roll(reached, -place).argmax())) % len(reached)

    def _orphan(self, view: View, cursor: int, least: float, stands: Flat) -> Stop | None:
        """Return a stop at the nearest point close by whose place on the tour the robot does not get to now.

        The point is ``least`` ticks old or older. The cursor stays where it is.
        """
        reached = stands[self.round.places] == self.round.places
        points = self.round.points[~reached[self.round.place_of]]
        points = points[stands[points] >= 0]
        ages = view.tick - np.maximum(view.fog.last_seen.reshape(-1)[points], 0)
        row, col = view.point_of((view.pose.x, view.pose.y))
        away = np.hypot(stands[points] // self._width - row, stands[points] % self._width - col)
        near = (ages >= least) & (away * view.ground.terrain.point <= NEAR * self._ahead_m)
        near &= view.fog.looked.reshape(-1)[points] != view.tick
        points, ages = points[near], ages[near]
        if not points.size:
            return None
        ways = view.lengths(within=NEAR * self._ahead_m).reshape(-1)[stands[points]]
        nearest = int(ways.argmin())
        if not np.isfinite(ways[nearest]):
            return None
        point = int(points[nearest])
        stand = divmod(int(stands[point]), self._width)
        return Stop(divmod(point, self._width), stand, int(ages[nearest]), cursor)

    def _first(self, view: View, first: int, until: int, least: float, given_up: GivenUp) -> Stop | None:
        """Return the first stale point of a stretch of places, in the order of the tour."""
        part = slice(int(self._firsts[first]), int(self._firsts[until]))
        points = self.round.points[part]
        ages = view.tick - np.maximum(view.fog.last_seen.reshape(-1)[points], 0)
        counts = (ages * self._times[part] >= least) & (view.fog.looked.reshape(-1)[points] != view.tick)
        stands, usable = self._stands.of(view, given_up, part)
        counts &= usable
        at = int(counts.argmax()) if counts.size else 0
        if not counts.size or not counts[at]:
            return None
        point, stand = divmod(int(points[at]), self._width), divmod(int(stands[at]), self._width)
        return Stop(point, stand, int(ages[at]), int(self.round.place_of[part][at]))
