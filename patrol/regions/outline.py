"""The outline of the free ground as polygons with few corners, from which regions are cut.

Stairs of points along slanted walls become one side each, ends of thin walls one corner, and obstacles smaller than
the tolerance vanish. Coordinates are in points, with (0, 0) at the lower left corner of point (0, 0).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from patrol.ground.terrain import BoolGrid
from patrol.kernels.regions import fewest_corners, trace
from patrol.regions.convex import FLAT, Floats, area, cross

Ints = NDArray[np.int64]

SHAVE = 0.5
"""Most free ground (points) that an outline may cut off at a corner: so little that each point keeps its
centre."""

NOTCH = 0.05
"""Distance, in points, by which corners that touch are drawn apart."""

_NO_SIDES = np.empty((0, 2, 2))


@dataclass(slots=True)
class Ring:
    """A closed polygon, free ground on its left."""

    corners: list[Floats]  # (x, y) each, float64 (2,)
    # by side, from its corner to the next: float64 (k, 2), the corners of the exact outline that it replaces
    skipped: list[Floats]


def loops_of(free: BoolGrid, fill: float) -> list[Floats]:
    """Return the exact outline of a mask as `trace_loops` does, without small holes.

    Holes whose sides are at most `fill` points long are left out.
    """
    loops = trace_loops(free)
    return [loop for loop in loops if np.ptp(loop, axis=0).max() > fill or area(loop) > 0.0]


def simplified(loops: Sequence[Floats], fill: float) -> list[Ring]:
    """Return an exact outline with few corners.

    Outer rings run counter-clockwise, holes clockwise; rings neither cross nor touch. The outline moves outwards by at
    most `fill` points, and inwards by at most SHAVE.
    """
    if not loops:
        return []
    everything = np.concatenate(loops)
    everything = everything[np.argsort(everything[:, 1], kind="stable")]
    rings = [_straighten_loop(loop, everything, fill) for loop in loops]
    sides = [_ring_sides(ring) for ring in rings]
    for number, ring in enumerate(rings):
        if _mergeable_corners(ring, fill).size:
            _merge_close_corners(ring, np.concatenate(sides[:number] + sides[number + 1 :] or [_NO_SIDES]), fill)
            sides[number] = _ring_sides(ring)
    return rings


def trace_loops(mask: BoolGrid) -> list[Floats]:
    """Return the exact outline of a mask, by loop: corners (x, y), float64 (n, 2), inside on the left.

    For example, of the point (0, 0) alone: (1, 0), (1, 1), (0, 1), (0, 0).

    Where two points touch at a corner only, each one's corner is drawn back by NOTCH, so that loops never touch.
    """
    framed = np.pad(mask, 1)
    around = framed[:-1, :-1].astype(np.int8) + framed[1:, :-1] + framed[:-1, 1:] + framed[1:, 1:]
    pinched = (around == 2) & (framed[:-1, :-1] == framed[1:, 1:]) & (framed[:-1, :-1] != framed[1:, :-1])
    # An odd number of points around makes one corner; two that only touch make two.
    count = int(np.count_nonzero(around % 2) + 2 * np.count_nonzero(pinched))
    corners = np.empty((count, 2), dtype=np.int32)
    # Each loop has four corners at least.
    ends = np.empty(count // 4 + 1, dtype=np.int32)
    passed = np.zeros((mask.shape[0] + 1, mask.shape[1] + 1), dtype=np.uint8)
    number = int(trace(np.ascontiguousarray(mask).view(np.uint8), passed, corners, ends))
    loops = []
    for loop in np.split(corners, ends[: max(number - 1, 0)]) if number else []:
        to = np.sign(loop - np.roll(loop, 1, axis=0))
        inward = np.roll(to, -1, axis=0) - to
        loops.append(loop + NOTCH * inward * pinched[loop[:, 1], loop[:, 0]][:, None])
    return loops


def _straighten_loop(loop: Floats, everything: Floats, fill: float) -> Ring:
    """Return the ring of a loop, so that nothing else of the outline lies between the two.

    everything: float64 (m, 2), all corners there are, by y.
    """
    n = len(loop)
    xs, ys = np.ascontiguousarray(loop[:, 0]), np.ascontiguousarray(loop[:, 1])
    work = (np.empty((2 * n + 1, 5)), np.empty(n + 1), np.empty(n + 1, dtype=np.int64), np.empty(n, dtype=np.int64))
    banned = np.empty((0, 2), dtype=np.int64)
    first = int(np.lexsort((xs, ys))[0])
    while True:
        # A corner that some best polygon has is found from a corner of the hull.
        chosen = work[3][: int(fewest_corners(xs, ys, first, banned, fill, SHAVE, *work))]
        middle = int(chosen[chosen.size // 2])
        chosen = work[3][: int(fewest_corners(xs, ys, middle, banned, fill, SHAVE, *work))]
        sides = [(int(i), int(j)) for i, j in zip(chosen, np.roll(chosen, -1), strict=True)]
        bad = [side for side in sides if _shuts_in(loop, side, everything)]
        # Too few corners, or turned inside out: the polygon has skipped too much.
        if not bad and (chosen.size < 3 or area(loop[chosen]) * area(loop) <= 0.0):
            longest = max(sides, key=lambda side: (side[1] - side[0]) % n)
            # No side skips anything, so this is the exact outline.
            if (longest[1] - longest[0]) % n == 1:
                break
            bad = [longest]
        if not bad:
            break
        banned = np.concatenate([banned, np.array(bad, dtype=np.int64)])
    return Ring([loop[i] for i, _ in sides], [loop[_corners_between(i, j, n)] for i, j in sides])


def _corners_between(i: int, j: int, n: int) -> Ints:
    """Return the indices of the corners passed on the way from i to j; for example 5 and 0 from 4 to 1 of six."""
    return np.arange(i + 1, j if j > i else j + n, dtype=np.int64) % n


def _shuts_in(loop: Floats, side: tuple[int, int], everything: Floats) -> bool:
    """Return True if corners of other parts of the outline lie between a side and the corners that it skips."""
    passed = _corners_between(*side, len(loop))
    if passed.size == 0:
        return False
    pocket = loop[np.concatenate([[side[0]], passed, [side[1]]])]
    low, high = pocket.min(axis=0), pocket.max(axis=0)
    # The end of a search is exclusive, so it goes on to the next larger number.
    near = everything[slice(*np.searchsorted(everything[:, 1], (low[1], np.nextafter(high[1], np.inf))))]
    near = near[(near[:, 0] >= low[0]) & (near[:, 0] <= high[0])]
    is_pocket = (near[:, None, :] == pocket[None, :, :]).all(axis=2).any(axis=1)
    return bool(_in_polygon(near[~is_pocket], pocket).any())


def _in_polygon(places: Floats, polygon: Floats) -> BoolGrid:
    """bool (k,): which places, (k, 2), lie in or on a polygon."""
    x, y = places[:, 0], places[:, 1]
    inside = np.zeros(len(places), dtype=np.bool_)
    on = np.zeros(len(places), dtype=np.bool_)
    for (x0, y0), (x1, y1) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        beside = (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0)
        within = (np.minimum(x0, x1) <= x) & (x <= np.maximum(x0, x1))
        within &= (np.minimum(y0, y1) <= y) & (y <= np.maximum(y0, y1))
        on |= within & (np.abs(beside) <= FLAT)
        # A horizontal side crosses no horizontal ray.
        if y0 != y1:
            inside ^= ((y >= y0) != (y >= y1)) & (x < x0 + (y - y0) * (x1 - x0) / (y1 - y0))
    return inside | on


def _ring_sides(ring: Ring) -> Floats:
    """float64 (n, 2, 2): the ends of a ring's sides."""
    corners = np.array(ring.corners)
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


def _mergeable_corners(ring: Ring, fill: float) -> Ints:
    """Return the corners of short sides between two concave corners, shortest first."""
    corners = np.array(ring.corners)
    back, ahead = np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0)
    concave = cross(corners - back, ahead - corners) < -FLAT
    length = np.hypot(*(ahead - corners).T)
    short = np.flatnonzero(concave & np.roll(concave, -1) & (length <= 4.0 * fill))
    return short[np.argsort(length[short], kind="stable")]


def _merge_close_corners(ring: Ring, others: Floats, fill: float) -> None:
    """Merge two concave corners with a short side between them into one, wherever the tolerances allow.

    An obstacle that is bevelled, or that ends in a thin wall, then takes one cut and not two.
    others: float64 (k, 2, 2), the sides of the other rings.
    """
    merging = True
    while merging and len(ring.corners) > 3:
        merging = any(_merge_at(ring, int(i), others, fill) for i in _mergeable_corners(ring, fill))


def _merge_at(ring: Ring, i: int, others: Floats, fill: float) -> bool:
    """Replace corner i and the next by one, if there is a good place for it; whether it was done."""
    n = len(ring.corners)
    before, j, after = (i - 1) % n, (i + 1) % n, (i + 2) % n
    a, first, second, b = (ring.corners[k] for k in (before, i, j, after))
    chain = np.concatenate([ring.skipped[before], [first], ring.skipped[i], [second], ring.skipped[j]])
    sides = np.delete(_ring_sides(ring), (before, i, j), axis=0)
    for meeting in _meeting_places(a, first, second, b, fill):
        if cross(meeting - a, b - meeting) >= -FLAT or not _may_replace(chain, a, meeting, b, fill):
            continue
        if not _is_free(np.concatenate([sides, others]), a, first, second, b, meeting):
            continue
        nearest = int(np.argmin(np.hypot(*(chain - meeting).T)))
        ring.corners[i] = meeting
        ring.skipped[before], ring.skipped[i] = chain[: nearest + 1], chain[nearest + 1 :]
        del ring.corners[j], ring.skipped[j]
        return True
    return False


def _is_free(sides: Floats, a: Floats, first: Floats, second: Floats, b: Floats, place: Floats) -> bool:
    """Return True if none of the other sides is in the way when two corners between a and b become one at a place."""
    bend = np.stack([a, first, second, b, place])
    near = ((sides.max(axis=1) >= bend.min(axis=0)) & (sides.min(axis=1) <= bend.max(axis=0))).all(axis=1)
    sides = sides[near]
    corners = sides[:, 0][(sides[:, 0] != b).any(axis=1)]
    for triangle in ((a, first, place), (first, second, place), (second, b, place)):
        if _in_triangle(corners, *triangle).any():
            return False
    return not (_crosses_sides(sides, a, place) or _crosses_sides(sides, place, b))


def _meeting_places(a: Floats, first: Floats, second: Floats, b: Floats, fill: float) -> list[Floats]:
    """Give the places where one corner may replace two: half-way between, and where the sides beyond them meet."""
    middle = 0.5 * (first + second)
    ahead, back = first - a, second - b
    turn = float(cross(ahead, back))
    if abs(turn) <= FLAT:
        return [middle]
    along = float(cross(b - a, back)) / turn
    meeting = a + along * ahead
    close = along > 0.0 and float(np.hypot(*(meeting - middle))) < 3.0 * fill
    return [middle, meeting] if close else [middle]


def _may_replace(chain: Floats, a: Floats, place: Floats, b: Floats, fill: float) -> bool:
    """Return True if the sides a, place, b, with a concave corner, keep within the tolerances of a chain of corners."""
    spot = place[None, :]
    if min(float(_side_distances(spot, here, ahead)[0]) for here, ahead in pairwise((a, *chain, b))) > 2.0 * fill:
        return False  # a long spike, although its sides pass close by the chain
    away = np.minimum(_side_distances(chain, a, place), _side_distances(chain, place, b))
    is_free = (cross(place - a, chain - a) > 0.0) | (cross(b - place, chain - place) > 0.0)
    return bool((away <= np.where(is_free, fill, SHAVE) + FLAT).all())


def _side_distances(places: Floats, a: Floats, b: Floats) -> Floats:
    """Distances of places, (k, 2), from the straight side from a to b."""
    side = b - a
    # A side of no length has no direction, and any share of it is its one place.
    share = np.clip((places - a) @ side / max(float(side @ side), 1e-300), 0.0, 1.0)
    distances: Floats = np.hypot(*(places - a - share[:, None] * side).T)
    return distances


def _in_triangle(places: Floats, a: Floats, b: Floats, c: Floats) -> BoolGrid:
    """bool (k,): which places, (k, 2), lie in or on a triangle, whichever way round it runs."""
    if len(places) == 0:
        return np.empty(0, dtype=np.bool_)
    sides = np.stack([cross(b - a, places - a), cross(c - b, places - b), cross(a - c, places - c)])
    return np.asarray((sides.min(axis=0) >= -FLAT) | (sides.max(axis=0) <= FLAT), dtype=np.bool_)


def _crosses_sides(sides: Floats, a: Floats, b: Floats) -> bool:
    """Return True if the line from a to b crosses any of some sides, (k, 2, 2)."""
    begin, end = sides[:, 0], sides[:, 1]
    apart = cross(b - a, begin - a) * cross(b - a, end - a)
    across = cross(end - begin, a - begin) * cross(end - begin, b - begin)
    # Strictly, since sides that touch do not cross.
    return bool(((apart < -FLAT) & (across < -FLAT)).any())
