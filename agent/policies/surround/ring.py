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
