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

from agent.belief.contacts import Place
from agent.policies.surround.assignment import assign
from agent.policies.surround.ring import FARTHEST, Spot, spots_around, spread
from agent.routes.ground import Ground
from agent.routes.kernels.wave import SETTLED, STATUS
from agent.routes.wave import Wave
from patrol.ground.footprint import Footprint
from patrol.pose import Pose
from patrol.radio.peers import Peer

if TYPE_CHECKING:
    from agent.routes.path_window import Window
    from patrol.ground.fields import StaticFields
    from patrol.ground.terrain import Terrain
    from patrol.scenario import Scenario

SPARE = 1.0
"""Room between two bodies that stand around an intruder, m."""

LONGEST = 2**26
"""Hundredths of a point: no path is longer."""


@dataclass(frozen=True, slots=True)
class Errand:
    """Where to go to stand around an intruder, x and y in m. place: to stand. bend: the first bend on the way."""

    place: Place
    bend: Place


class Surround:
    """One robot's part in surrounding an intruder."""

    def __init__(
        self, scenario: Scenario, number: int, terrain: Terrain, fields: StaticFields, scratch: dict[str, Window]
    ) -> None:
        """scratch: as for `agent.policies.potential_field.field.Field`."""
        self._number = number
        self._radius = scenario.patrol.surround_distance
        self._repulsion = scenario.patrol.surround_repulsion
        self._spacing = 2.0 * max(spec.radius for spec in scenario.roster) + SPARE
        self._reach = fields.reach
        self._terrain = terrain
        self._scratch = scratch
        outer = min(FARTHEST * self._radius, scenario.sensor.range)
        self._sight = Footprint(terrain, max(outer, terrain.point))
        self._ring: _Ring | None = None

    def errand(
        self, pose: Pose, peers: Mapping[int, Peer], contacts: Sequence[Place], ground: Ground, start: tuple[int, int]
    ) -> Errand | None:
        """What the robot does about the contacts; None when there is nothing for it to do.

        pose: its own, as others hear it. peers: those heard from lately. ground: as it is now; start: its open element
        (row, col) where the robot stands.
        """
        places = {self._number: (pose.x, pose.y)} | {n: (peer.pose.x, peer.pose.y) for n, peer in peers.items()}
        target = {number: _nearest(place, contacts) for number, place in places.items()}
        mine = target[self._number]
        team = sorted(number for number, place in target.items() if place == mine)
        ring = self._ring_of(mine, len(team))
        if not ring.spots:
            return None
        from_spots = [[_length(lengths, ring.ground.join(*places[n])) for n in team] for lengths in ring.lengths]
        takes = assign([[length * length for length in row] for row in from_spots])
        for spot, row, index in zip(ring.spots, from_spots, takes, strict=True):
            if team[index] == self._number:
                return self._way(spot, row[index], ground, start)
        return None

    def pushed(self, pose: Pose, peers: Mapping[int, Peer], bend: Place) -> Place:
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

    def _ring_of(self, intruder: Place, count: int) -> _Ring:
        """The places around an intruder for so many robots, computed when one of the two changes."""
        if self._ring is None or (self._ring.intruder, self._ring.count) != (intruder, count):
            ground = self._ring.ground if self._ring is not None else Ground(self._terrain, self._reach)
            spots = spread(spots_around(self._sight, self._reach, *intruder, self._radius), count, self._spacing)
            lengths = []
            for spot in spots:
                at = spot.row + 1, spot.col + 1
                lengths.append(self._wave().lengths_from(ground, *at, [at], LONGEST))
            self._ring = _Ring(intruder, count, ground, spots, lengths)
        return self._ring

    def _way(self, spot: Spot, length: int, ground: Ground, start: tuple[int, int]) -> Errand:
        """The way to a spot over the ground as it is now, or to the nearest place that there is a way to.

        length: of the way when nothing is closed, hundredths of a point.
        """
        if start == (spot.row + 1, spot.col + 1):
            return Errand((spot.x, spot.y), (spot.x, spot.y))
        wave = self._wave()
        wave.begin(ground, *start)
        row, col = spot.row - wave.row0, spot.col - wave.col0
        for limit in (length, LONGEST):
            if wave.state[row, col] & STATUS != SETTLED:
                wave.extend(limit)
        if wave.state[row, col] & STATUS != SETTLED:
            rows, cols = np.nonzero(wave.state & STATUS == SETTLED)
            nearest = int(np.argmin((rows - row) ** 2 + (cols - col) ** 2))
            row, col = int(rows[nearest]), int(cols[nearest])
        bend_row, bend_col = divmod(int(wave.bend[row, col]), wave.state.shape[1])
        place = self._terrain.centre(row + wave.row0, col + wave.col0)
        return Errand(place, self._terrain.centre(bend_row + wave.row0, bend_col + wave.col0))

    def _wave(self) -> Wave:
        """A window over the whole terrain; made when first needed."""
        height, width = self._terrain.shape
        key = f"whole {height} {width}"
        if key not in self._scratch:
            self._scratch[key] = Wave(height, width, max(height, width))
        wave = self._scratch[key]
        assert isinstance(wave, Wave)
        return wave


@dataclass(frozen=True, slots=True)
class _Ring:
    """The places around an intruder for so many robots; lengths: of the paths from each, int32 (h + 2, w + 2)."""

    intruder: Place
    count: int
    ground: Ground
    spots: list[Spot]
    lengths: list[NDArray[np.int32]]


def _nearest(place: Place, contacts: Sequence[Place]) -> Place:
    return min(contacts, key=lambda contact: (math.dist(place, contact), contact))


def _length(lengths: NDArray[np.int32], element: tuple[int, int] | None) -> int:
    return LONGEST if element is None else min(int(lengths[element]), LONGEST)
