"""One-way zones: the steps that lead against them, and the ground from which ways lead back.

A way is a row of steps to neighbouring points. Step w leads in the direction of w times 45 degrees, from x towards y.
Zones have one of these eight directions. A step leads against a zone if one of its ends lies in the zone and its angle
with the zone's direction is more than 90 degrees:

    a zone of 0 degrees      from each of its points   . > >        steps 3, 4 and 5 lead against it:
                                                       . o >        0b00111000
                                                       . > >

So ways lead along a zone or across it, and no way comes out farther back than it came in.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.errors import BadInput

if TYPE_CHECKING:
    from patrol.ground.terrain import BoolGrid, Terrain

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

Steps = NDArray[np.uint8]


def with_direction(against: Steps, points: BoolGrid, degrees: int) -> Steps:
    """Add the steps that lead against a zone.

    Args:
        against: uint8 (height, width), bit w is set where step w leads against another zone; of size 0 for none.
        points: bool (height, width), the zone's.
        degrees: Its direction, a multiple of `TURN`.

    Returns:
        The same with the zone, read-only.
    """
    both = against.copy() if against.size else np.zeros(points.shape, dtype=np.uint8)
    height, width = points.shape
    framed = np.pad(points, 1)
    for turn in (3, 4, 5):
        step = (degrees // TURN + turn) % len(STEPS)
        up, across = STEPS[step]
        reached = framed[1 + up : 1 + up + height, 1 + across : 1 + across + width]
        both[points | reached] |= np.uint8(1 << step)
    both.flags.writeable = False
    return both


def unit(degrees: int) -> tuple[float, float]:
    """Return x and y of a direction of length 1.

    Args:
        degrees: From x towards y.
    """
    angle = math.radians(degrees)
    return math.cos(angle), math.sin(angle)


def lengths_along(
    reach: BoolGrid, against: Steps, starts: list[tuple[int, int]], limit: int, *, back: bool = False
) -> NDArray[np.int32]:
    """Find the lengths of the ways from the nearest of several points, or to it.

    Args:
        reach: bool (height, width), where a body's centre may be.
        against: As of `Terrain.against`.
        starts: Rows and columns of points of the reach.
        limit: The longest way, in hundredths of a point.
        back: Find the ways to the starts instead of those from them.

    Returns:
        int32 (height + 2, width + 2), in hundredths of a point, framed by one point on every side; `FAR` where no way
        leads.
    """
    from patrol.ground.kernels.one_way import FAR, measure  # here: few processes need it

    is_open, steps = np.pad(reach, 1).view(np.uint8), np.pad(against, 1)
    width = is_open.shape[1]
    length = np.full(is_open.shape, FAR, dtype=np.int32)
    flat = np.array([(row + 1) * width + col + 1 for row, col in sorted(set(starts))], dtype=np.int64)
    measure(is_open, steps, flat, back, -1, limit, length)
    return length


def way_along(reach: BoolGrid, against: Steps, first: tuple[int, int], last: tuple[int, int]) -> list[tuple[int, int]]:
    """Find a short way between two points: the straight line, else the shortest way pulled taut.

    Args:
        reach: As for `lengths_along`.
        against: As for `lengths_along`.
        first: Row and column of a point.
        last: Row and column of a point to which a way leads from there.

    Returns:
        Rows and columns of the way's corners, with both ends. Straight lines between them lead against no zone.

    Raises:
        ValueError: No way leads there.
    """
    from patrol.ground.kernels.one_way import FAR, corners, is_clear, measure

    is_open, steps = np.pad(reach, 1).view(np.uint8), np.pad(against, 1)
    width = is_open.shape[1]
    begin, end = ((row + 1) * width + col + 1 for row, col in (first, last))
    if first == last or is_clear(is_open, steps, begin, end):
        return [first, last]
    length = np.full(is_open.shape, FAR, dtype=np.int32)
    measure(is_open, steps, np.array([end]), True, begin, FAR, length)
    if length.flat[begin] == FAR:
        raise ValueError(f"no way leads from {first} to {last}")
    way = np.empty(length.size, dtype=np.int64)
    rows, cols = np.divmod(way[: corners(is_open, steps, begin, end, length, way)], width)
    return list(zip((rows - 1).tolist(), (cols - 1).tolist(), strict=True))


def first_bend(
    reach: BoolGrid, against: Steps, length: NDArray[np.int32], first: tuple[int, int], last: tuple[int, int]
) -> tuple[int, int]:
    """Find where the shortest way from one point to another first bends, pulled taut.

    Args:
        reach: As for `lengths_along`.
        against: As for `lengths_along`.
        length: Lengths of the ways to the last point, as `lengths_along` finds them.
        first: Row and column of a point from which a way leads there.
        last: Row and column of the other.

    Returns:
        Row and column; the last point where the way does not bend. The straight line there leads against no zone.
    """
    from patrol.ground.kernels.one_way import corners

    width = length.shape[1]
    begin, end = ((row + 1) * width + col + 1 for row, col in (first, last))
    way = np.empty(2, dtype=np.int64)
    count = corners(np.pad(reach, 1).view(np.uint8), np.pad(against, 1), begin, end, length, way)
    row, col = divmod(int(way[count - 1]), width)
    return row - 1, col - 1


def ground_with_ways_back(terrain: Terrain, reach: BoolGrid, radius: float) -> BoolGrid:
    """Leave out the points of connected ground from which no way leads back, or to which none leads.

    In a zone, such points lie in niches that are open against its direction. Where one is larger than `NICHE`, the
    zones are refused instead.

    Args:
        terrain: The ground, with one-way zones.
        reach: bool (height, width), one connected part of where a body's centre may be.
        radius: Of the body, m.

    Returns:
        The part that is left, bool (height, width): ways lead from each of its points to each other.

    Raises:
        BadInput: A larger part would be left out.
    """
    from patrol.ground.fields import parts_of  # here: it imports this module

    kept, ways_lead_to = np.zeros_like(reach), np.zeros_like(reach)
    left = reach & (terrain.against == 0)
    left = left if left.any() else reach.copy()
    for _ in range(MOST_PARTS):
        if np.count_nonzero(left) <= np.count_nonzero(kept):
            break
        start = [divmod(int(left.argmax()), terrain.width)]
        to, back = (_reached(terrain, reach, start, back=back) for back in (False, True))
        if np.count_nonzero(to & back) > np.count_nonzero(kept):
            kept, ways_lead_to = to & back, to
        left &= ~(to & back)
    labels, count = parts_of(reach & ~kept)
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
    return kept


def _reached(terrain: Terrain, reach: BoolGrid, start: list[tuple[int, int]], *, back: bool) -> BoolGrid:
    from patrol.ground.kernels.one_way import FAR

    return np.asarray(lengths_along(reach, terrain.against, start, FAR, back=back)[1:-1, 1:-1] < FAR)
