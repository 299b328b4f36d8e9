"""The ring around an intruder: where robots may stand in sight of it, and which of those places lie farthest apart."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from patrol.ground.footprint import Footprint
from patrol.ground.terrain import BoolGrid
from patrol.pose import TAU, Pose

BEARINGS = 120
"""Number of bearings from the intruder for which a place is considered."""

NEAREST = 0.25
FARTHEST = 1.25
"""Smallest and largest distance of a place from the intruder where a wall prevents the ring itself, in ring radii."""

FINE = math.radians(0.1)
"""Precision of the widest gap, rad."""


@dataclass(frozen=True, slots=True)
class Stand:
    """A place to stand.

    Attributes:
        bearing: From the intruder, 0 to 2 pi rad.
        row: Row of the point in the terrain.
        col: Column of the point in the terrain.
        x: Of the point's centre, m.
        y: Of the point's centre, m.
    """

    bearing: float
    row: int
    col: int
    x: float
    y: float


def spots_around(sight: Footprint, reach: BoolGrid, x: float, y: float, radius: float) -> list[Stand]:
    """For each of `BEARINGS` bearings from an intruder, the place nearest to the ring.

    Args:
        sight: What can be seen from the intruder; only points in sight of it count.
        reach: bool (h, w), the points on which a robot's centre may be; only these count.
        x: Of the intruder, m.
        y: Of the intruder, m.
        radius: Of the ring, m.

    Returns:
        At most one place for each bearing, by bearing.
    """
    view = sight.visible(Pose(x, y, 0.0))
    terrain = sight.terrain
    rows, cols = np.nonzero(view.mask)
    rows, cols = rows + view.row0, cols + view.col0
    there = reach[rows, cols]
    rows, cols = rows[there], cols[there]
    across = terrain.origin[0] + (cols + 0.5) * terrain.point - x
    up = terrain.origin[1] + (rows + 0.5) * terrain.point - y
    away = np.hypot(across, up)
    fits = (away >= NEAREST * radius) & (away <= FARTHEST * radius)
    rows, cols, across, up, away = rows[fits], cols[fits], across[fits], up[fits], away[fits]
    bearing = np.array([math.atan2(*offset) for offset in zip(up.tolist(), across.tolist(), strict=True)]) % TAU
    sector = np.minimum((bearing * (BEARINGS / TAU)).astype(np.int64), BEARINGS - 1)
    order = np.lexsort((np.abs(away - radius), sector))
    first = order[np.unique(sector[order], return_index=True)[1]]
    found = [
        Stand(float(bearing[i]), int(rows[i]), int(cols[i]), *terrain.centre(int(rows[i]), int(cols[i]))) for i in first
    ]
    return sorted(found, key=lambda spot: (spot.bearing, spot.row, spot.col))


def spread(spots: Sequence[Stand], count: int, spacing: float) -> list[Stand]:
    """Return the choice of spots that makes the smallest gap between their bearings as wide as possible.

    Args:
        spots: By bearing.
        count: Largest number of spots to choose.
        spacing: Smallest distance between two of them, m.

    Returns:
        ``count`` spots, or as many as fit.
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
    """The first ``count`` spots that keep ``gap`` rad and ``spacing`` m from each other; none if there are fewer."""
    bearings = [spot.bearing for spot in spots]
    for start in range(len(spots)):
        chosen = [spots[start]]
        end = bearings[start] + TAU - gap
        index = start
        while len(chosen) < count:
            index = bisect_left(bearings, chosen[-1].bearing + gap, lo=index + 1)
            while index < len(spots) and not _apart(chosen, spots[index], spacing):
                index += 1
            if index >= len(spots) or bearings[index] > end:
                break
            chosen.append(spots[index])
        if len(chosen) == count:
            return chosen
    return []


def _apart(chosen: Sequence[Stand], spot: Stand, spacing: float) -> bool:
    return all(math.hypot(spot.x - other.x, spot.y - other.y) >= spacing for other in chosen)
