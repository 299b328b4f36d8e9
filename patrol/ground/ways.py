"""Ways over the ground, which lead against no one-way zone: lengths, first bends, and the ground with ways back.

A way is a row of steps to neighbouring points. Step w leads in the direction of w times 45 degrees, from x towards y.
Zones have one of these eight directions. A step leads against a zone if one of its ends lies in the zone and its angle
with the zone's direction is more than 90 degrees:

    a zone of 0 degrees      from each of its points   . > >        steps 3, 4 and 5 lead against it:
                                                       . o >        0b00111000
                                                       . > >

So ways lead along a zone or across it, and no way comes out farther back than it came in.

The kernels of ways are loaded where they are used, as few processes need them.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from patrol.errors import BadInput
from patrol.ground.cspace import parts_of
from patrol.ground.terrain import BoolGrid, Steps, Terrain, frozen_grid


def framed(reach: BoolGrid, against: Steps) -> tuple[NDArray[np.uint8], Steps]:
    """Return the ground as the kernels of ways take it: framed by one point on every side.

    The first grid is uint8, 1 where a body's centre may be; the second holds the steps against zones, of size 0 for
    none.
    """
    return np.pad(reach, 1).view(np.uint8), np.pad(against, 1) if against.size else against


def lengths_along(
    reach: BoolGrid, against: Steps, starts: list[tuple[int, int]], limit: int, *, back: bool = False
) -> NDArray[np.int32]:
    """Return the lengths of the ways from the nearest of several points, or with `back` to it.

    The result is int32 (height + 2, width + 2), framed by one point on every side, in hundredths of a point as is
    `limit`, the longest way; `FAR` where no way leads. The starts are rows and columns without the frame.
    """
    from patrol.kernels.ways import FAR, wave

    is_open, steps = framed(reach, against)
    width = is_open.shape[1]
    length = np.full(is_open.shape, FAR, dtype=np.int32)
    flat = np.array([(row + 1) * width + col + 1 for row, col in sorted(set(starts))], dtype=np.int64)
    wave(is_open, steps, flat, back, -1, limit, length, np.empty((2, is_open.size, 2), dtype=np.int32))
    return length


def first_bend(
    reach: BoolGrid, against: Steps, length: NDArray[np.int32], first: tuple[int, int], last: tuple[int, int]
) -> tuple[int, int]:
    """Return the (row, col) where the shortest way from one point to another, pulled taut, first bends.

    It is `last` where the way does not bend. The straight line there leads against no zone. `length` has the lengths of
    the ways to `last`, framed as by `lengths_along`; rows and columns are without the frame.
    """
    from patrol.kernels.ways import corners

    width = length.shape[1]
    begin, end = ((row + 1) * width + col + 1 for row, col in (first, last))
    way = np.empty(2, dtype=np.int32)
    count = corners(*framed(reach, against), begin, end, length, way)
    row, col = divmod(int(way[count - 1]), width)
    return row - 1, col - 1


TURN = 45
"""Angle between two directions, degrees."""

STEPS = ((0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1))
"""Rows and columns of each step, in the order of their directions."""

ARROWS = "→↗↑↖←↙↓↘"
"""A sign for each direction."""

MOST_PARTS = 32
"""Parts of the ground, each with ways between all of its points, of which the largest is kept."""

NICHE = 4.0
"""Area of the largest niche that is left out, in areas of the body."""


def with_direction(against: Steps, points: BoolGrid, degrees: int) -> Steps:
    """Return `against` with the steps that lead against one more zone, read-only.

    Bit w is set where step w leads against a zone; `against` may be `ALL_WAYS`. `degrees` is the zone's direction, a
    multiple of `TURN`.
    """
    combined = against.copy() if against.size else np.zeros(points.shape, dtype=np.uint8)
    height, width = points.shape
    padded = np.pad(points, 1)
    for turn in (3, 4, 5):
        step = (degrees // TURN + turn) % len(STEPS)
        up, across = STEPS[step]
        reached = padded[1 + up : 1 + up + height, 1 + across : 1 + across + width]
        combined[points | reached] |= np.uint8(1 << step)
    combined.flags.writeable = False
    return combined


def unit(degrees: int) -> tuple[float, float]:
    """Return x and y of the unit vector in a direction, given in degrees from x towards y."""
    angle = math.radians(degrees)
    return math.cos(angle), math.sin(angle)


def ground_with_ways_back(terrain: Terrain, reach: BoolGrid, radius: float) -> BoolGrid:
    """Leave out the points of connected ground from which no way leads back, or to which none leads.

    In a zone, such points lie in niches that are open against its direction. Where one is larger than `NICHE`, the
    zones are refused instead. `reach` is one connected part of where a body's centre may be. Returns what is left of
    it, read-only; it is found once, and kept in `Terrain.with_ways_back`.
    """
    key = radius, int(reach.argmax())
    if key not in terrain.with_ways_back:
        terrain.with_ways_back[key] = _with_ways_back(terrain, reach, radius)
    return terrain.with_ways_back[key]


def _with_ways_back(terrain: Terrain, reach: BoolGrid, radius: float) -> BoolGrid:
    best, ways_lead_to = np.zeros_like(reach), np.zeros_like(reach)
    candidates = reach & (terrain.against == 0)
    candidates = candidates if candidates.any() else reach.copy()
    for _ in range(MOST_PARTS):
        if np.count_nonzero(candidates) <= np.count_nonzero(best):
            break
        start = [divmod(int(candidates.argmax()), terrain.width)]
        to, back = (_reached_ground(terrain, reach, start, back=back) for back in (False, True))
        if np.count_nonzero(to & back) > np.count_nonzero(best):
            best, ways_lead_to = to & back, to
        candidates &= ~(to & back)
    labels, count = parts_of(reach & ~best)
    sizes = np.bincount(labels.reshape(-1), minlength=count + 1)
    sizes[0] = 0
    if sizes.max() * terrain.point_area > NICHE * math.pi * radius**2:
        largest = labels == int(sizes.argmax())
        row, col = divmod(int(largest.argmax()), terrain.width)
        x, y = terrain.centre(row, col)
        where = f"{sizes.max() * terrain.point_area:.1f} m² around ({x:.4g}, {y:.4g}) of {terrain.name}"
        leads = f"no way leads back from {where}" if ways_lead_to[row, col] else f"no way leads to {where}"
        raise BadInput(
            f"zones: one_way: {leads} for a body of radius {radius:g} m; turn a zone round, make it shorter or drop it"
        )
    return frozen_grid(best)


def _reached_ground(terrain: Terrain, reach: BoolGrid, start: list[tuple[int, int]], *, back: bool) -> BoolGrid:
    from patrol.kernels.ways import FAR

    return np.asarray(lengths_along(reach, terrain.against, start, FAR, back=back)[1:-1, 1:-1] < FAR)
