"""Surrounding an intruder: robots stand around it, spread, for as long as somebody reports it.

The paper: "we create the attraction force exerted on every robot from the intruder; we nullify forces exerted on robots
by observed territory and introduce relatively weak forces repelling robots from each other, so that they surround the
intruder". On open ground that ends with the robots equally spaced on the circle where attraction ends. Among walls such
forces have other equilibria as well: two robots on one side of a wall push each other along it and leave the other
side empty. So every robot computes where the repulsion should leave the fleet, instead of waiting for it: places in
sight of the intruder, near the circle, that lie as far apart in bearing as the walls allow. Which of them is whose
makes the sum of the squares of all ways least, so that nobody has to pass another who stands on the way, but takes
over its place. Positions are all that needs, so all robots find the same; and since every step along a way lowers that
sum, and so does every exchange of places, they settle. Each is attracted to its place along the wave's paths, and
pushed a little by others close by on the way there.

A robot for which no place is left, because the ring is full or cannot be reached, patrols on. Of several intruders each
robot takes the nearest.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agent.policies.surround.assignment import assign
from agent.policies.surround.ring import FARTHEST, Stand, spots_around, spread
from agent.ports import Place, State
from agent.routes.ground import Ground, Spot
from agent.routes.routes import LONGEST, Routes, Way
from patrol.ground.footprint import Footprint
from patrol.pose import Pose
from patrol.radio.peers import Peer

if TYPE_CHECKING:
    from agent.ports import Intent, Policy, PolicySetup
    from agent.view import View

SPARE = 1.0
"""Room between two bodies that stand around an intruder, m."""


class Surround:
    """A policy for whoever knows of an intruder: its part in surrounding it. Another policy decides otherwise."""

    def __init__(self, setup: PolicySetup, otherwise: Policy) -> None:
        """Join a patrol.

        Args:
            setup: As for every policy.
            otherwise: What the robot does when nothing is to be surrounded, or no place is left for it.
        """
        self._otherwise = otherwise
        self._number = setup.spec.number
        self._radius = setup.patrol.surround_distance
        self._repulsion = setup.patrol.surround_repulsion
        self._spacing = 2.0 * max(setup.radii.values()) + SPARE
        self._reach = setup.fields.reach
        self._terrain = setup.terrain
        outer = min(FARTHEST * self._radius, setup.sensor.range)
        self._sight = Footprint(setup.terrain, max(outer, setup.terrain.point))
        self._ring: _Ring | None = None

    def decide(self, view: View) -> Intent:
        """Take a place around the nearest intruder, or do what is done otherwise."""
        start = view.start
        way = None
        if view.contacts and start is not None:
            way = self.way(view.reported, view.peers, view.contacts, view.routes, start)
        if way is None:
            return self._otherwise.decide(view)
        far = math.dist((view.pose.x, view.pose.y), way.place) > view.stride
        lean = self.pushed(view.pose, view.peers, way.bend) if far else None
        return Place(*way.place, bend=way.bend, lean=lean, state=State.SURROUNDING)

    def way(
        self,
        pose: Pose,
        peers: Mapping[int, Peer],
        contacts: Sequence[Spot],
        routes: Routes,
        start: tuple[int, int],
    ) -> Way | None:
        """The way to the robot's own place around the nearest intruder.

        Args:
            pose: Its own, as others hear it.
            peers: Those heard from lately, by number.
            contacts: The intruders, x and y in m.
            routes: Over the ground as it is now.
            start: The open element (row, col) of the ground on which the robot stands.

        Returns:
            None when no place is left for it.
        """
        places = {self._number: (pose.x, pose.y)} | {n: (peer.pose.x, peer.pose.y) for n, peer in peers.items()}
        target = {number: _nearest(place, contacts) for number, place in places.items()}
        mine = target[self._number]
        team = sorted(number for number, place in target.items() if place == mine)
        ring = self._ring_of(mine, len(team), routes)
        if not ring.stands:
            return None
        from_spots = [[_length(lengths, ring.ground.join(*places[n])) for n in team] for lengths in ring.lengths]
        takes = assign([[length * length for length in row] for row in from_spots])
        for stand, row, index in zip(ring.stands, from_spots, takes, strict=True):
            if team[index] == self._number:
                return routes.way(start, (stand.row + 1, stand.col + 1), row[index])
        return None

    def pushed(self, pose: Pose, peers: Mapping[int, Peer], bend: Spot) -> Spot:
        """The point as far off as ``bend`` (m) in the direction that others close by leave of the way there."""
        across, up = bend[0] - pose.x, bend[1] - pose.y
        distance = math.hypot(across, up)
        if distance == 0.0:
            return bend
        x, y = across / distance, up / distance
        for _, peer in sorted(peers.items()):
            away_x, away_y = pose.x - peer.pose.x, pose.y - peer.pose.y
            apart = math.hypot(away_x, away_y)
            if apart > 0.0:
                push = self._repulsion * math.exp(-((2.0 * apart / self._radius) ** 2)) / apart
                x, y = x + push * away_x, y + push * away_y
        length = math.hypot(x, y)
        return (pose.x + distance * x / length, pose.y + distance * y / length) if length > 0.0 else bend

    def _ring_of(self, intruder: Spot, count: int, routes: Routes) -> _Ring:
        """The places around an intruder for so many robots, computed when one of the two changes."""
        if self._ring is None or (self._ring.intruder, self._ring.count) != (intruder, count):
            ground = self._ring.ground if self._ring is not None else Ground(self._terrain, self._reach)
            stands = spread(spots_around(self._sight, self._reach, *intruder, self._radius), count, self._spacing)
            lengths = []
            for stand in stands:
                at = stand.row + 1, stand.col + 1
                lengths.append(routes.window().lengths_from(ground, *at, [at], LONGEST))
            self._ring = _Ring(intruder, count, ground, stands, lengths)
        return self._ring


@dataclass(frozen=True, slots=True)
class _Ring:
    """The places around an intruder for so many robots; lengths: of the paths from each, int32 (h + 2, w + 2)."""

    intruder: Spot
    count: int
    ground: Ground
    stands: list[Stand]
    lengths: list[NDArray[np.int32]]


def _nearest(place: Spot, contacts: Sequence[Spot]) -> Spot:
    return min(contacts, key=lambda contact: (math.dist(place, contact), contact))


def _length(lengths: NDArray[np.int32], element: tuple[int, int] | None) -> int:
    return LONGEST if element is None else min(int(lengths[element]), LONGEST)
