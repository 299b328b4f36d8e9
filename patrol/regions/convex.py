"""Convex polygons in the plane: float64 (k, 2) corners, counter-clockwise, in any unit of length."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

FLAT = 1e-9
"""Angles whose sine is nearer to 0 than this are straight."""


def area(polygon: NDArray[np.float64] | NDArray[np.int64]) -> float:
    """Return the signed area of any polygon, (k, 2): positive where it runs counter-clockwise.

    For example, the square (0, 0), (0, 1), (1, 1), (1, 0) runs clockwise and has the area -1.
    """
    ahead = np.roll(polygon, -1, axis=0)
    return 0.5 * float(np.sum(polygon[:, 0] * ahead[:, 1] - polygon[:, 1] * ahead[:, 0]))


def circumference(polygon: Floats) -> float:
    """Return the length of a polygon's sides."""
    return float(np.hypot(*(np.roll(polygon, -1, axis=0) - polygon).T).sum())


def hull(places: Floats) -> Floats:
    """Return the convex hull of places, (n, 2), counter-clockwise and without corners on straight sides."""
    # Along a side that is upright but for rounding, places are in the order of y. Else its end might be taken for a
    # place in its middle.
    order = sorted(map(tuple, places.tolist()), key=lambda place: (round(place[0], 9), place[1]))
    chains: list[list[tuple[float, ...]]] = []
    for run in (order, order[::-1]):
        chain: list[tuple[float, ...]] = []
        for x, y in run:
            while len(chain) > 1:
                (ax, ay), (bx, by) = chain[-2], chain[-1]
                longest = max(abs(bx - ax), abs(by - ay), abs(x - bx), abs(y - by))
                if (bx - ax) * (y - by) - (by - ay) * (x - bx) > FLAT * longest:
                    break
                chain.pop()
            chain.append((x, y))
        chains.append(chain[:-1])
    return np.array(chains[0] + chains[1])


def outward(polygon: Floats) -> tuple[Floats, Floats]:
    """Return the sides of a convex polygon as lines.

    These are the unit normals, (k, 2), which point outward, and how far along its normal each side lies, (k,).
    """
    sides = np.roll(polygon, -1, axis=0) - polygon
    normals = np.stack([sides[:, 1], -sides[:, 0]], axis=1)
    # A side of length 0 has a normal of 0 and so bounds nothing.
    normals /= np.maximum(np.hypot(*sides.T), 1e-300)[:, None]
    return normals, np.einsum("ij,ij->i", normals, polygon)


def overlap(polygon: Floats, other: Floats) -> float:
    """Return the depth of two overlapping convex polygons: the shortest way to part them.

    It is a length, 0 or less when they are apart.
    """
    deepest = np.inf
    for base, facing in ((polygon, other), (other, polygon)):
        normals, reach = outward(base)
        # Two convex polygons are apart if one of their sides separates them; else the least depth over all sides
        # counts.
        deepest = min(deepest, float((reach - (facing @ normals.T).min(axis=0)).min()))
    return deepest


def depths(polygon: Floats, places: Floats) -> Floats:
    """Return the depth of each place, (n, 2), within a convex polygon; below 0 outside.

    For example, the middle of a square with sides of 2 has the depth 1, and a place 0.5 beside it -0.5.
    """
    normals, reach = outward(polygon)
    inside: Floats = (reach - places @ normals.T).min(axis=1)
    return inside
