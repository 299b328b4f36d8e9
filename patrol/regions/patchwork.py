"""Pieces of the ground side by side: they are made exactly convex, and scraps are merged.

Polygons are float64 (k, 2), counter-clockwise, in points. They are disjoint, and stay so.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from patrol.regions.convex import Floats, area, circumference, cross, dents, depths, hull, left_of, outward, overlap

POCKET = 1.0
"""Largest depth, in points, of a merged region in walls beside its parts."""

TOUCHING = 1e-6
"""Polygons that overlap by less than this, in points or square points, only touch."""


class Patchwork:
    """Disjoint polygons, and the boxes around them."""

    def __init__(self, polygons: Sequence[Floats]) -> None:
        self.polygons: dict[int, Floats] = {}
        self._low = np.full((0, 2), np.inf)
        self._high = np.full((0, 2), -np.inf)
        for polygon in polygons:
            self.add(polygon)

    def add(self, polygon: Floats) -> None:
        """Add a polygon, under the next number."""
        number = len(self._low)
        self._low = np.concatenate([self._low, np.full((1, 2), np.inf)])
        self._high = np.concatenate([self._high, np.full((1, 2), -np.inf)])
        self.put(number, polygon)

    def put(self, number: int, polygon: Floats) -> None:
        """Replace a polygon."""
        self.polygons[number] = polygon
        self._low[number], self._high[number] = polygon.min(axis=0), polygon.max(axis=0)

    def drop(self, number: int) -> None:
        """Take a polygon away."""
        del self.polygons[number]
        self._low[number], self._high[number] = np.inf, -np.inf

    def near(self, polygon: Floats, margin: float = 0.0) -> list[int]:
        """Return the numbers of the polygons whose boxes come within `margin` points of a polygon's box."""
        low, high = polygon.min(axis=0) - margin, polygon.max(axis=0) + margin
        return [int(i) for i in np.flatnonzero(((self._low <= high) & (self._high >= low)).all(axis=1))]

    def is_clear(self, polygon: Floats, *besides: int) -> bool:
        """Return True if a convex polygon at most touches the others, apart from those numbered in `besides`."""
        neighbours = (self.polygons[number] for number in self.near(polygon) if number not in besides)
        return all(overlap(polygon, neighbour) <= TOUCHING for neighbour in neighbours)

    def rest(self, number: int, gainer: Floats) -> Floats | None:
        """Return a polygon without what it shares with a convex one; None if no straight cut takes just that."""
        polygon = shared = self.polygons[number]
        sides = list(zip(gainer, np.roll(gainer, -1, axis=0), strict=True))
        for a, b in sides:
            shared = left_of(shared, a, b)
        lost = area(shared) if len(shared) else 0.0
        if lost <= TOUCHING:
            return polygon
        rests = (left_of(polygon, b, a) for a, b in sides)
        return next(
            (remainder for remainder in rests if len(remainder) and area(polygon) - area(remainder) - lost <= TOUCHING),
            None,
        )


def made_convex(pieces: Sequence[Floats]) -> list[Floats]:
    """Return the pieces without their dents; together they cover the same ground.

    A dent is filled, and what the piece so gains of its neighbours is cut off them; where a neighbour would have to
    give more than that, the piece is cut in two along a side at its dent instead.
    """
    work = Patchwork([piece if dents(piece).any() else hull(piece) for piece in pieces if area(piece) > TOUCHING])
    for number in list(work.polygons):
        piece = work.polygons[number]
        if not dents(piece).any():
            continue
        filled = hull(piece)
        rests = {neighbour: work.rest(neighbour, filled) for neighbour in work.near(filled) if neighbour != number}
        if all(remainder is not None for remainder in rests.values()):
            for neighbour, remainder in rests.items():
                if remainder is not None:
                    work.put(neighbour, remainder)
            work.put(number, filled)
        else:
            first, *offcuts = _cut_at_dents(piece)
            work.put(number, first)
            for other_piece in offcuts:
                work.add(other_piece)
    return [polygon for polygon in work.polygons.values() if area(polygon) > TOUCHING]


def _cut_at_dents(polygon: Floats) -> list[Floats]:
    """A polygon's convex pieces, cut along the extension of a side at each dent so that one is as large as can be."""
    concave = np.flatnonzero(dents(polygon))
    if concave.size == 0:
        return [hull(polygon)]
    i = int(concave[0])
    turned = np.roll(polygon, -i, axis=0)
    ways = (turned[0] - turned[-1], turned[0] - turned[1])
    halves = max((_split_polygon(turned, way) for way in ways), key=lambda pair: max(map(area, pair)))
    return [piece for half in halves for piece in _cut_at_dents(half)]


def _split_polygon(polygon: Floats, way: Floats) -> tuple[Floats, Floats]:
    """Both sides of a straight cut through a polygon, from its first corner, a dent, in a direction."""
    begin, end = polygon[1:-1] - polygon[0], polygon[2:] - polygon[0]
    first, second = cross(way, begin), cross(way, end)
    crossed = np.flatnonzero((first <= 0.0) & (second > 0.0))
    share = first[crossed] / (first[crossed] - second[crossed])
    places = begin[crossed] + share[:, None] * (end[crossed] - begin[crossed])
    away = places @ way
    away[away <= 0.0] = np.inf
    k = int(np.argmin(away))
    corner = polygon[0] + places[k]
    cut = int(crossed[k]) + 2
    return np.concatenate([polygon[:cut], [corner]]), np.concatenate([[polygon[0], corner], polygon[cut:]])


def merged(polygons: Sequence[Floats]) -> list[Floats]:
    """Merge convex polygons, the smallest first, each with the neighbour that makes the most compact whole.

    The whole is their hull: it may reach POCKET into walls, and into no other polygon.
    """
    work = Patchwork(polygons)
    waiting = sorted(range(len(polygons)), key=lambda number: area(polygons[number]))
    while waiting:
        number = waiting.pop(0)
        if number not in work.polygons:
            continue
        best = max(_find_mergers(work, number), key=lambda merger: merger[0], default=None)
        if best is not None:
            work.put(number, best[2])
            work.drop(best[1])
            waiting.append(number)
    return list(work.polygons.values())


def _find_mergers(work: Patchwork, number: int) -> Iterator[tuple[float, int, Floats]]:
    """Give the wholes that a polygon can become: compactness, partner, whole."""
    polygon = work.polygons[number]
    for partner in work.near(polygon, TOUCHING):
        neighbour = work.polygons[partner]
        if partner == number or overlap(polygon, neighbour) < -TOUCHING:
            continue
        union = hull(np.concatenate([polygon, neighbour]))
        if _pocket_depth(union, polygon, neighbour) <= POCKET and work.is_clear(union, number, partner):
            yield area(union) / circumference(union) ** 2, partner, union


def _pocket_depth(whole: Floats, polygon: Floats, other: Floats) -> float:
    """Return the reach of two polygons' hull beyond them: from the ends of the border that they share."""
    is_own, is_other = ((whole[:, None] == part[None]).all(axis=2).any(axis=1) for part in (polygon, other))
    spanning = ~(is_own & np.roll(is_own, -1)) & ~(is_other & np.roll(is_other, -1))
    corners = np.concatenate([polygon, other])
    on_both = (depths(polygon, corners) >= -TOUCHING) & (depths(other, corners) >= -TOUCHING)
    normals, reach = outward(whole)
    away = reach[spanning, None] - normals[spanning] @ corners[on_both].T
    return float(away.min(axis=1, initial=np.inf).max(initial=0.0))


def stretched(polygons: Sequence[Floats], places: Floats) -> list[Floats]:
    """Stretch convex polygons to hold places just outside them, wherever no other polygon is in the way."""
    work = Patchwork(polygons)
    for target in places:
        spot = target[None, :]
        wholes = {number: hull(np.concatenate([work.polygons[number], spot])) for number in work.near(spot, POCKET)}
        gains = {number: area(outline) - area(work.polygons[number]) for number, outline in wholes.items()}
        for number in sorted(gains, key=lambda number: (gains[number], number)):
            if work.is_clear(wholes[number], number):
                work.put(number, wholes[number])
                break
    return list(work.polygons.values())
