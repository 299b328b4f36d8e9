"""Surrounding an intruder: robots spread around it for as long as any robot reports it.

The paper: "we create the attraction force exerted on every robot from the intruder; we nullify forces exerted on robots
by observed territory and introduce relatively weak forces repelling robots from each other, so that they surround the
intruder". On open ground that ends with the robots equally spaced on the circle where attraction ends. Among walls such
forces have other equilibria too: two robots on one side of a wall push each other along it and leave the other side
empty. So every robot computes where the repulsion should leave the fleet: places in sight of the intruder, near the
circle, as far apart in bearing as the walls allow. The places are assigned so that the sum of the squared path lengths
is least. Then no robot has to pass another one that stands in its way; it takes over that robot's place. This needs
only positions, so all robots find the same assignment. Every step along a way lowers the sum, and so does every
exchange of places, so the robots settle. Each is attracted to its place along the wave's paths and, on the way, pushed
aside a little by others close by.

A robot for which no place is left, because the ring is full or out of reach, continues to patrol. With several
intruders each robot takes the nearest.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agent.ports import Bearing, Place, State, Stay
from agent.routes.ground import Ground, Spot
from agent.routes.routes import Routes, Way
from agent.routes.wave import LONGEST, paths_in
from patrol.ground.footprint import Footprint
from patrol.ground.sensors import footprint_of
from patrol.ground.terrain import BoolGrid
from patrol.pose import TAU, Pose
from patrol.radio.peers import Peer
from patrol.scenario.lengths import STANDING_GAP

if TYPE_CHECKING:
    from agent.ports import Intent, Policy, PolicySetup
    from agent.view import View


def assign(costs: Sequence[Sequence[int]]) -> list[int]:
    """Return the column of each row, all different, so that the sum of costs is least.

    Uses the Hungarian method by shortest augmenting paths, for at most as many rows as columns. Sums are exact, so all
    robots that know the same costs find the same assignment.
    """
    rows, cols = len(costs), len(costs[0]) if costs else 0
    by_row, by_col = [0] * (rows + 1), [0] * (cols + 1)
    owner, came = [0] * (cols + 1), [0] * (cols + 1)
    for row in range(1, rows + 1):
        owner[0] = row
        here = 0
        cheapest: list[int | None] = [None] * (cols + 1)
        used = [False] * (cols + 1)
        while owner[here]:
            used[here] = True
            mine = owner[here]
            step, nearest = None, 0
            for col in range(1, cols + 1):
                if used[col]:
                    continue
                cost = costs[mine - 1][col - 1] - by_row[mine] - by_col[col]
                lowest = cheapest[col]
                if lowest is None or cost < lowest:
                    cheapest[col] = lowest = cost
                    came[col] = here
                if step is None or lowest < step:
                    step, nearest = lowest, col
            assert step is not None  # there are no fewer columns than rows
            for col in range(cols + 1):
                ahead = cheapest[col]
                if used[col]:
                    by_row[owner[col]] += step
                    by_col[col] -= step
                elif ahead is not None:
                    cheapest[col] = ahead - step
            here = nearest
        while here:
            owner[here] = owner[came[here]]
            here = came[here]
    columns = {owner[col]: col - 1 for col in range(1, cols + 1)}
    return [columns[row] for row in range(1, rows + 1)]


BEARINGS = 120
"""Number of bearings from the intruder for which a place is considered."""

NEAREST = 0.25
FARTHEST = 1.25
"""Smallest and largest distance of a place from the intruder where a wall prevents the ring itself, in ring radii."""

FINE = math.radians(0.1)
"""Precision of the widest gap, rad."""


@dataclass(frozen=True, slots=True)
class Stand:
    """A place to stand: a point of the terrain, and x and y of its centre in m."""

    bearing: float  # from the intruder, rad, 0 to 2 pi
    row: int
    col: int
    x: float
    y: float


def spots_around(sight: Footprint, reach: BoolGrid, x: float, y: float, radius: float) -> list[Stand]:
    """Return the place nearest to the ring for each of `BEARINGS` bearings from an intruder, by bearing.

    Only places in ``reach`` count, and in sight of the intruder at x and y in m, so a bearing may have none.
    """
    view = sight.visible(Pose(x, y, 0.0))
    terrain = sight.terrain
    rows, cols = np.nonzero(view.mask)
    rows, cols = rows + view.row0, cols + view.col0
    is_reached = reach[rows, cols]
    rows, cols = rows[is_reached], cols[is_reached]
    across = terrain.origin[0] + (cols + 0.5) * terrain.point - x
    up = terrain.origin[1] + (rows + 0.5) * terrain.point - y
    away = np.hypot(across, up)
    fits = (away >= NEAREST * radius) & (away <= FARTHEST * radius)
    rows, cols, across, up, away = rows[fits], cols[fits], across[fits], up[fits], away[fits]
    bearing = np.array([math.atan2(*offset) for offset in zip(up.tolist(), across.tolist(), strict=True)]) % TAU
    sector = np.minimum((bearing * (BEARINGS / TAU)).astype(np.int64), BEARINGS - 1)
    order = np.lexsort((np.abs(away - radius), sector))
    first = order[np.unique(sector[order], return_index=True)[1]]
    stands = [
        Stand(float(bearing[i]), int(rows[i]), int(cols[i]), *terrain.centre(int(rows[i]), int(cols[i]))) for i in first
    ]
    return sorted(stands, key=lambda spot: (spot.bearing, spot.row, spot.col))


def spread(spots: Sequence[Stand], count: int, spacing: float) -> list[Stand]:
    """Return up to ``count`` spots that make the smallest gap between their bearings as wide as possible.

    The spots given are in the order of their bearings. Those returned are ``spacing`` m or more apart; fewer than
    ``count`` where no more fit.
    """
    count = min(count, len(spots))
    while count > 0 and not (chosen := _with_gap(spots, count, 0.0, spacing)):
        count -= 1
    if count == 0:
        return []
    low, high = 0.0, TAU / count
    if widest := _with_gap(spots, count, high, spacing):
        return widest
    while high - low > FINE:
        gap = 0.5 * (low + high)
        if better := _with_gap(spots, count, gap, spacing):
            low, chosen = gap, better
        else:
            high = gap
    return chosen


def _with_gap(spots: Sequence[Stand], count: int, gap: float, spacing: float) -> list[Stand]:
    """Return the first ``count`` spots that are ``gap`` rad and ``spacing`` m or more apart, or none."""
    bearings = [spot.bearing for spot in spots]
    for start in range(len(spots)):
        chosen = [spots[start]]
        end = bearings[start] + TAU - gap
        index = start
        while len(chosen) < count:
            index = bisect_left(bearings, chosen[-1].bearing + gap, lo=index + 1)
            while index < len(spots) and not _is_apart(chosen, spots[index], spacing):
                index += 1
            if index >= len(spots) or bearings[index] > end:
                break
            chosen.append(spots[index])
        if len(chosen) == count:
            return chosen
    return []


def _is_apart(chosen: Sequence[Stand], spot: Stand, spacing: float) -> bool:
    return all(math.hypot(spot.x - stand.x, spot.y - stand.y) >= spacing for stand in chosen)


class Surround:
    """A policy that takes part in surrounding an intruder, and otherwise leaves the decision to another policy."""

    def __init__(self, setup: PolicySetup, otherwise: Policy) -> None:
        self.otherwise = otherwise
        self._number = setup.robot.spec.number
        self._radius = setup.robot.lengths.surround_distance
        self._repulsion = setup.fleet.patrol.surround_repulsion
        self._by_forces = "surround-forces" in setup.fleet.patrol.paper_rules
        self._spacing = 2.0 * max(setup.fleet.radii.values()) + STANDING_GAP
        self._reach = setup.ground.fields.reach
        self._terrain = setup.ground.terrain
        outer = min(FARTHEST * self._radius, setup.ground.sight.range_m)
        self._sight = footprint_of(setup.ground.terrain, max(outer, setup.ground.terrain.point))
        self._ring: _Ring | None = None

    def decide(self, view: View) -> Intent:
        """Take a place around the nearest intruder, or let the other policy decide."""
        start = view.start
        way = None
        if view.contacts and start is not None:
            if self._by_forces:
                return self._find_pull(view)
            way = self.way(view.reported, view.peers, view.contacts, view.routes, start)
        if way is None:
            return self.otherwise.decide(view)
        far = math.dist((view.pose.x, view.pose.y), way.place) > view.stride
        lean = self.pushed(view.pose, view.peers, way.bend) if far else None
        return Place(*way.place, bend=way.bend, lean=lean, state=State.SURROUNDING)

    def _find_pull(self, view: View) -> Intent:
        """Return the direction of the paper's forces: attraction from outside the ring, repulsion everywhere."""
        pose, here = view.pose, (view.pose.x, view.pose.y)
        intruder = _find_nearest(here, view.contacts)
        way = view.way(intruder) if math.dist(here, intruder) > self._radius else None
        x, y = 0.0, 0.0
        if way is not None and (distance := math.dist(here, way.bend)) > 0.0:
            x, y = (way.bend[0] - pose.x) / distance, (way.bend[1] - pose.y) / distance
        x, y = self._add_repulsion(pose, view.peers, x, y)
        if x == 0.0 == y:
            return Stay(State.SURROUNDING)
        return Bearing((math.atan2(y, x),), state=State.SURROUNDING)

    def way(
        self, pose: Pose, peers: Mapping[int, Peer], contacts: Sequence[Spot], routes: Routes, start: tuple[int, int]
    ) -> Way | None:
        """Return the way to the robot's own place around the nearest intruder; None where none is left for it.

        ``pose`` is the robot's own as others hear it, so that all find the same assignment.
        """
        places = {self._number: (pose.x, pose.y)} | {n: (peer.pose.x, peer.pose.y) for n, peer in peers.items()}
        target = {number: _find_nearest(spot, contacts) for number, spot in places.items()}
        mine = target[self._number]
        team = sorted(number for number, spot in target.items() if spot == mine)
        ring = self._ring_of(mine, len(team))
        if not ring.stands:
            return None
        from_spots = [[_read_length(lengths, ring.ground.join(*places[n])) for n in team] for lengths in ring.lengths]
        takes = assign([[length * length for length in row] for row in from_spots])
        for stand, row, index in zip(ring.stands, from_spots, takes, strict=True):
            if team[index] == self._number:
                return routes.way(start, (stand.row + 1, stand.col + 1), row[index])
        return None

    def pushed(self, pose: Pose, peers: Mapping[int, Peer], bend: Spot) -> Spot:
        """Return the next bend, turned about the robot by the repulsion of peers close by."""
        across, up = bend[0] - pose.x, bend[1] - pose.y
        distance = math.hypot(across, up)
        if distance == 0.0:
            return bend
        x, y = self._add_repulsion(pose, peers, across / distance, up / distance)
        length = math.hypot(x, y)
        return (pose.x + distance * x / length, pose.y + distance * y / length) if length > 0.0 else bend

    def _add_repulsion(self, pose: Pose, peers: Mapping[int, Peer], x: float, y: float) -> tuple[float, float]:
        """Return the sum of a force (x, y) and the repulsion of peers close by."""
        for _, peer in sorted(peers.items()):
            away_x, away_y = pose.x - peer.pose.x, pose.y - peer.pose.y
            apart = math.hypot(away_x, away_y)
            if apart > 0.0:
                push = self._repulsion * math.exp(-((2.0 * apart / self._radius) ** 2)) / apart
                x, y = x + push * away_x, y + push * away_y
        return x, y

    def _ring_of(self, intruder: Spot, count: int) -> _Ring:
        """Return the ring for ``count`` robots, a new one when the intruder or the number changes."""
        if self._ring is None or (self._ring.intruder, self._ring.count) != (intruder, count):
            ground = self._ring.ground if self._ring is not None else Ground(self._terrain, self._reach)
            stands = spread(spots_around(self._sight, self._reach, *intruder, self._radius), count, self._spacing)
            box = 0, self._terrain.height, 0, self._terrain.width
            lengths = [paths_in(ground, [(s.row, s.col)], box, LONGEST).length for s in stands]
            self._ring = _Ring(intruder, count, ground, stands, lengths)
        return self._ring


@dataclass(frozen=True, slots=True)
class _Ring:
    """The places around an intruder for ``count`` robots."""

    intruder: Spot
    count: int
    ground: Ground  # with nothing closed
    stands: list[Stand]  # by bearing
    lengths: list[NDArray[np.int32]]  # (h + 2, w + 2), of the paths to each stand, in hundredths of a point


def _find_nearest(place: Spot, contacts: Sequence[Spot]) -> Spot:
    return min(contacts, key=lambda contact: (math.dist(place, contact), contact))


def _read_length(lengths: NDArray[np.int32], element: tuple[int, int] | None) -> int:
    return LONGEST if element is None else min(int(lengths[element]), LONGEST)
