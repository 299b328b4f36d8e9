"""Giving way: how robots that block each other come free, from positions alone.

The paper's robots block each other until random moves part them, which takes very long in a doorway. Here, of two
robots that bumped, the one with the higher number gives way: for a while it treats the other as an obstacle, so that
the force that pulled it through the other now pulls it round, or elsewhere. A robot that has been blocked for long
gives way in any case, because the other may have nowhere to go. Where no way leads round the other, neither gives way:
one of them goes back (`agent.bodies.passing`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from agent.routes.ground import Disc, Spot
from patrol.pose import Pose
from patrol.radio.peers import Peer, places_of

SHORTEST_S = 3.0
LONGEST_S = 10.0
"""Bounds of how long a robot gives way, s; the time is random, so that a pair does not get stuck in step."""

PATIENCE = 8
"""Number of bumps in a row after which a robot gives way to a higher number too."""

ROUNDING_M = 1e-6
"""Largest error of a distance that was computed in arrays, m."""


def nearest(pose: Pose, peers: Mapping[int, Peer], radii: Mapping[int, float]) -> tuple[float, int]:
    """Return the distance from the robot's centre to the nearest other body, m, and that robot's number.

    They are infinity and 0 where there is none.
    """
    if not peers:
        return math.inf, 0
    numbers, places = sorted(peers), places_of(peers)
    gaps = np.hypot(places[:, 0] - pose.x, places[:, 1] - pose.y) - [radii[number] for number in numbers]
    # Arrays round in ways of their own, so they only tell who is worth a closer look.
    worth = np.flatnonzero(~(gaps > np.fmin.reduce(gaps) + ROUNDING_M))
    near = [(numbers[index], peers[numbers[index]].pose) for index in worth]
    return min((math.hypot(there.x - pose.x, there.y - pose.y) - radii[number], number) for number, there in near)


def disc_round(there: Spot, here: Spot, radii: float, point: float) -> Disc:
    """Return the disc around one robot, at `there`, that is closed to the centre of another, at `here`.

    It is as wide as both bodies together, but never covers the other robot's own point. `radii` is the sum of both
    radii, `point` the side of the terrain's points, both in m.
    """
    apart = math.hypot(there[0] - here[0], there[1] - here[1]) - point
    return *there, max(0.0, min(radii + 0.5 * point, apart))


class Bumps:
    """The count of bumps that follow each other closely."""

    def __init__(self, calm: float) -> None:
        """Start with none; bumps more than `calm` ticks apart do not add up."""
        self.count = 0
        self._calm = calm
        self._at = 0

    def add(self, tick: int) -> None:
        """Take in a bump."""
        self.count = self.count + 1 if tick - self._at <= self._calm else 1
        self._at = tick

    def clear(self) -> None:
        """Start again with none."""
        self.count = 0


class GiveWay:
    """The robots to which one robot gives way, and until when."""

    def __init__(self, number: int, chance: Callable[[int], float], radii: Mapping[int, float], step: float) -> None:
        """Start without giving way; radii are in m, `step` is in s per tick.

        `chance` is called with a tick and returns a repeatable draw from [0, 1).
        """
        self._step = step
        self._number = number
        self._chance = chance
        self._radii = radii
        self._until: dict[int, int] = {}
        self._bumps = 0

    def update(self, tick: int, pose: Pose, bumped: bool, peers: Mapping[int, Peer], near: float) -> None:
        """Take in whether the last move was cancelled.

        The nearest peer counts as the cause when the gap between the two bodies is at most `near` m.
        """
        if not bumped:
            self._bumps = 0
            return
        self._bumps += 1
        gap, other = nearest(pose, peers, self._radii)
        if gap <= self._radii[self._number] + near and (other < self._number or self._bumps > PATIENCE):
            spell = SHORTEST_S + (LONGEST_S - SHORTEST_S) * self._chance(tick)
            self._until[other] = tick + round(spell / self._step)

    def stop(self, other: int) -> None:
        """Give way to a robot no longer."""
        self._until.pop(other, None)
        self._bumps = 0

    def discs(self, tick: int, pose: Pose, peers: Mapping[int, Peer], point: float) -> list[Disc]:
        """Return the discs of the peers that are obstacles now, in order of robot number.

        They are as wide as both bodies together, but never cover the robot's own point. `point` is the side of the
        terrain's points, m.
        """
        found = []
        for other, until in sorted(self._until.items()):
            if tick < until:
                there, both = peers[other].pose, self._radii[other] + self._radii[self._number]
                found.append(disc_round((there.x, there.y), (pose.x, pose.y), both, point))
        return found
