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
"""Bearings as seen from the intruder among which places are chosen."""

NEAREST = 0.25
FARTHEST = 1.25
"""How near to the intruder and how far from it a place may be where a wall forbids the ring, in ring radii."""

FINE = math.radians(0.1)
"""How well the widest gap is found, rad."""


@dataclass(frozen=True, slots=True)
class Stand:
    """A place to stand. row, col: of the terrain. x, y: of its centre, m. bearing: from the intruder, 0 to 2 pi rad."""

    bearing: float
    row: int
    col: int
    x: float
    y: float


def spots_around(sight: Footprint, reach: BoolGrid, x: float, y: float, radius: float) -> list[Stand]:
    """For each of `BEARINGS` bearings from (x, y) the place nearest to the ring of ``radius`` m, by bearing.

    Only points of ``reach``, bool (h, w), in sight of (x, y) count; a bearing may have none.
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
    bearing = np.arctan2(up, across) % TAU
    sector = np.minimum((bearing * (BEARINGS / TAU)).astype(np.int64), BEARINGS - 1)
    off = np.abs(away - radius)
    fits = (away >= NEAREST * radius) & (away <= FARTHEST * radius)
    order = np.lexsort((off, sector))
    order = order[fits[order]]
    first = order[np.unique(sector[order], return_index=True)[1]]
    found = [
        Stand(float(bearing[i]), int(rows[i]), int(cols[i]), *terrain.centre(int(rows[i]), int(cols[i]))) for i in first
    ]
    return sorted(found, key=lambda spot: (spot.bearing, spot.row, spot.col))


def spread(spots: Sequence[Stand], count: int, spacing: float) -> list[Stand]:
    """At most ``count`` of the spots, so that the least gap between their bearings is as wide as can be.

    spots: by bearing. spacing: m between two of them. Fewer where not so many fit.
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
    """The first ``count`` spots that keep ``gap`` rad and ``spacing`` m from each other, or none."""
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
