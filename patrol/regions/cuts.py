"""Straight cuts that leave only convex pieces of the free ground, as few and as fat as can be had.

Every concave corner of the outline needs a cut. One that joins two concave corners serves both, so as many such cuts
as fit beside each other are taken, short ones first; the other corners are cut off along the shortest way to a wall or
to another cut. Coordinates are in points.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray

from patrol.kernels.regions import partners, shorten
from patrol.regions.convex import FLAT, Floats, area, cross
from patrol.regions.outline import Ring

Ints = NDArray[np.int64]

SLACK = 1.0
"""Largest error, in points, of a cut between two corners that should leave convex angles."""

DENT = 0.25
"""Largest depth, in points, of a corner that juts into a piece."""

MARGIN = 0.5
"""Least distance, in points, of a cut from corners that it passes, and of its end from one that it might end in."""

LONGEST = 2.0
"""Factor by which a cut that serves two corners may be longer than the two cuts that it saves."""


@dataclass(slots=True)
class Plan:
    """Corners and sides of the outline, and the cuts made so far."""

    corners: Floats  # (n, 2), in points
    before: Ints  # (n,), the neighbour before each corner
    after: Ints  # (n,), the neighbour after each corner
    concave: Ints  # (m,), indices of the concave corners
    # (x, y) where cuts end on a side or another cut; numbered from n on
    ends: list[tuple[float, float]] = field(default_factory=list)
    cuts: list[tuple[int, int]] = field(default_factory=list)  # pairs of numbers, of corners or ends
    # ends on a line, as (share of the way, number); lines are sides by first corner, then cuts
    stops: dict[int, list[tuple[float, int]]] = field(default_factory=dict)

    def place(self, number: int) -> tuple[float, float]:
        """Return (x, y) of a corner or of a cut's end, by its number."""
        n = len(self.corners)
        if number >= n:
            return self.ends[number - n]
        x, y = self.corners[number]
        return float(x), float(y)

    def shorten(self, concave: Ints, begin: Floats, end: Floats, first: int, ways: Floats) -> None:
        """Call `patrol.kernels.regions.shorten` with the plan's corners; it changes `ways` in place."""
        shorten(self.corners, self.before, self.after, concave, begin, end, first, ways)

    def no_ways(self) -> Floats:
        """float64 (n, 5): ways of infinite length from all corners."""
        ways = np.full((len(self.corners), 5), -1.0)
        ways[:, 0] = math.inf
        return ways


def convex_pieces(rings: Sequence[Ring]) -> list[Floats]:
    """Return the pieces into which cuts divide the ground inside the rings.

    Each is float64 (k, 2), counter-clockwise, in points. Angles exceed 180 degrees by SLACK at most.
    """
    if not rings:
        return []
    plan = _make_plan(rings)
    _part_at_touches(plan)
    for v, w in best_set(*_shared_cuts(plan)):
        plan.cuts.append((v, w))
    _cut_off_the_rest(plan)
    return list(_walk_faces(plan))


def _make_plan(rings: Sequence[Ring]) -> Plan:
    corners = np.concatenate([np.array(ring.corners) for ring in rings])
    before = np.empty(len(corners), dtype=np.int64)
    after = np.empty(len(corners), dtype=np.int64)
    first = 0
    for ring in rings:
        numbers = np.arange(first, first + len(ring.corners))
        before[numbers], after[numbers] = np.roll(numbers, 1), np.roll(numbers, -1)
        first += len(numbers)
    to, onward = corners - corners[before], corners[after] - corners
    longer = np.maximum(np.hypot(*to.T), np.hypot(*onward.T))
    turn, ahead = cross(to, onward), np.einsum("ij,ij->i", to, onward) > 0.0
    # The cross product over the longer side is about the corner's depth, so that shallow dents stay.
    return Plan(corners, before, after, np.flatnonzero(turn < np.where(ahead, -DENT * longer, -FLAT)))


def _part_at_touches(plan: Plan) -> None:
    """Let concave corners that lie on another side end there: the side parts the angle, so no cut is needed."""
    begin, along = plan.corners, plan.corners[plan.after] - plan.corners
    length = np.hypot(*along.T)
    touching = set()
    for v in plan.concave.tolist():
        offset = plan.corners[v] - begin
        share = (offset * along).sum(axis=1) / length**2
        on = (np.abs(cross(along, offset)) <= FLAT * length) & (share > 0.0) & (share < 1.0)
        # Its own two sides do not count.
        on[[v, plan.before[v]]] = False
        for side in np.flatnonzero(on).tolist():
            plan.stops.setdefault(side, []).append((float(share[side]), v))
            touching.add(v)
    plan.concave = np.array([v for v in plan.concave.tolist() if v not in touching], dtype=np.int64)


def _shared_cuts(plan: Plan) -> tuple[list[tuple[int, int]], Floats, Floats]:
    """Return the cuts that serve two concave corners, shortest first, and their two ends, float64 (k, 2) each."""
    begin, end = plan.corners, np.ascontiguousarray(plan.corners[plan.after])
    ways = plan.no_ways()
    plan.shorten(plan.concave, begin, end, 0, ways)
    reach = np.ascontiguousarray(ways[:, 0])
    is_partner = np.empty(plan.concave.size, dtype=np.uint8)
    cuts: list[tuple[int, int]] = []
    for v in plan.concave:
        partners(plan.corners, plan.before, plan.after, plan.concave, reach, int(v), LONGEST, SLACK, MARGIN, is_partner)
        cuts += [(int(v), int(w)) for w in plan.concave[is_partner != 0]]
    ends = np.array(cuts, dtype=np.int64).reshape(-1, 2)
    first, second = plan.corners[ends[:, 0]], plan.corners[ends[:, 1]]
    order = np.argsort(np.hypot(*(second - first).T), kind="stable")
    return [cuts[i] for i in order], first[order], second[order]


def best_set(cuts: Sequence[tuple[int, int]], first: Floats, second: Floats) -> list[tuple[int, int]]:
    """Choose as many cuts as possible that neither cross nor share a corner, preferring shorter ones.

    For example, of (0, 1) and (1, 2), which share a corner, only the shorter (0, 1).

    A local optimum: no chosen cut can be exchanged for two others, nor for a shorter one. `cuts` must come shortest
    first; the rows of `first` and `second`, float64 (k, 2), are their ends.
    """
    ends = np.array(cuts, dtype=np.int64).reshape(-1, 2)
    rivals = [set(map(int, np.flatnonzero(_cut_conflicts(i, ends, first, second)))) for i in range(len(cuts))]
    chosen: set[int] = set()
    for i in range(len(cuts)):
        if not rivals[i] & chosen:
            chosen.add(i)
    improved = True
    while improved:
        improved = False
        for i in sorted(chosen):
            # Cuts that nothing but this one keeps out: two for one, or a shorter one for a longer.
            waiting = sorted(j for j in rivals[i] if len(rivals[j] & chosen) == 1)
            pair = next((pair for pair in combinations(waiting, 2) if pair[1] not in rivals[pair[0]]), None)
            better = pair or tuple(j for j in waiting[:1] if j < i)
            if not better:
                continue
            chosen = chosen - {i} | set(better)
            for j in sorted(rivals[i]):
                if not rivals[j] & chosen:
                    chosen.add(j)
            improved = True
    return [cuts[i] for i in sorted(chosen)]


def _cut_conflicts(i: int, at: Ints, first: Floats, second: Floats) -> NDArray[np.bool_]:
    """bool (k,): which cuts cannot be made beside cut i. at: int64 (k, 2), their corners."""
    way, ways = second[i] - first[i], second - first
    apart = cross(way, first - first[i]) * cross(way, second - first[i])
    across = cross(ways, first[i] - first) * cross(ways, second[i] - first)
    crossing = (apart < -FLAT) & (across < -FLAT)
    sharing = (at == at[i, 0]).any(axis=1) | (at == at[i, 1]).any(axis=1)
    clash: NDArray[np.bool_] = crossing | sharing
    clash[i] = False
    return clash


def _cut_off_the_rest(plan: Plan) -> None:
    """Cut off the corners that no cut serves yet, always along the shortest way that is left to any."""
    n = len(plan.corners)
    served = {corner for cut in plan.cuts for corner in cut}
    waiting = np.array([v for v in plan.concave if int(v) not in served], dtype=np.int64)
    begin = np.array([plan.corners[v] for v in (*range(n), *(v for v, _ in plan.cuts))])
    end = np.array([plan.corners[w] for w in (*plan.after, *(w for _, w in plan.cuts))])
    ways = plan.no_ways()
    plan.shorten(waiting, begin, end, 0, ways)
    while waiting.size:
        v = int(waiting[np.argmin(ways[waiting, 0])])
        waiting = waiting[waiting != v]
        # No cut from this corner ends anywhere, so it stays.
        if ways[v, 4] < 0.0:
            continue
        to = _cut_end(plan, v, ways[v])
        plan.cuts.append((v, to))
        # The cut may serve the corner in which it ends as well.
        if to in waiting and _leaves_convex(plan, to, v):
            waiting = waiting[waiting != to]
        start, stop = np.array([plan.place(v)]), np.array([plan.place(to)])
        # For corners that wait, the new cut may be nearer than a wall.
        plan.shorten(waiting, start, stop, n + len(plan.cuts) - 1, ways)


def _cut_end(plan: Plan, v: int, way: Floats) -> int:
    """The number of the place where a cut from corner v ends: an end of the line that it meets, when that is near."""
    n = len(plan.corners)
    share, x, y, line = float(way[1]), float(way[2]), float(way[3]), int(way[4])
    ends = (line, int(plan.after[line])) if line < n else plan.cuts[line - n]
    for number in (*ends, *(stop for _, stop in plan.stops.get(line, ()))):
        if number != v and math.dist(plan.place(number), (x, y)) < MARGIN and _leaves_convex(plan, v, number):
            return number
    plan.ends.append((x, y))
    number = n + len(plan.ends) - 1
    plan.stops.setdefault(line, []).append((share, number))
    return number


def _leaves_convex(plan: Plan, corner: int, other: int) -> bool:
    """Return True if a cut from a corner to another place leaves convex angles at the corner."""
    target = np.array([plan.place(other)])
    ways = plan.no_ways()
    plan.shorten(np.array([corner]), target, target, 0, ways)
    return bool(ways[corner, 4] == 0.0)


def _walk_faces(plan: Plan) -> Iterator[Floats]:
    """The pieces between sides and cuts: walk along each with the piece on the left, turning left as much as can be."""
    n = len(plan.corners)
    lines = [(v, int(plan.after[v])) for v in range(n)] + plan.cuts
    onward: dict[int, list[int]] = {}
    for number, (v, w) in enumerate(lines):
        stops = [stop for _, stop in sorted(plan.stops.get(number, ()))]
        for here, ahead in pairwise([v, *stops, w]):
            onward.setdefault(here, []).append(ahead)
            if number >= n:
                onward.setdefault(ahead, []).append(here)
    bearing = {(here, ahead): _cut_bearing(plan, here, ahead) for here, ways in onward.items() for ahead in ways}
    walked: set[tuple[int, int]] = set()
    # By number, so that the order of regions is always the same.
    for here, ways in sorted(onward.items()):
        for ahead in ways:
            if (here, ahead) in walked:
                continue
            piece: list[int] = []
            step = (here, ahead)
            while step not in walked:
                walked.add(step)
                piece.append(step[0])
                corner = step[1]
                back = _cut_bearing(plan, corner, step[0])
                # The first way clockwise from the one back, which itself comes last.
                turns = [((back - bearing[corner, to]) % math.tau or math.tau, to) for to in onward[corner]]
                step = (corner, min(turns)[1])
            loops = [np.array([plan.place(number) for number in loop]) for loop in _simple_loops(piece)]
            # A loop that runs clockwise goes round a hole, which only the whole piece leaves out.
            is_parted = all(area(loop) > -FLAT for loop in loops)
            yield from loops if is_parted else [np.array([plan.place(number) for number in piece])]


def _simple_loops(walk: Sequence[int]) -> list[list[int]]:
    """Part a closed walk where it comes to a place again, so that no loop goes through a place twice.

    Where a corner of one ring lies on a cut, the walk round a piece goes past it on both sides, and the piece would
    overlap itself. For example, 1, 2, 3, 2, 4 has the loops (2, 3) and (1, 2, 4).
    """
    loops: list[list[int]] = []
    path: list[int] = []
    for number in walk:
        if number in path:
            first = path.index(number)
            loops.append(path[first:])
            del path[first:]
        path.append(number)
    return [*loops, path]


def _cut_bearing(plan: Plan, here: int, there: int) -> float:
    (x0, y0), (x1, y1) = plan.place(here), plan.place(there)
    return math.atan2(y1 - y0, x1 - x0)
