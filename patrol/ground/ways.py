"""Ways over the ground, which lead against no one-way zone: their lengths, and where they first bend.

Their kernels are loaded where they are used, as few processes need them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from patrol.ground.terrain import BoolGrid, Steps


def framed(reach: BoolGrid, against: Steps) -> tuple[NDArray[np.uint8], Steps]:
    """Return the ground as the kernels of ways take it: framed by one point on every side.

    Args:
        reach: bool (height, width), where a body's centre may be.
        against: As of `Terrain.against`.

    Returns:
        uint8 (height + 2, width + 2), 1 where a body's centre may be, and the steps against zones; of size 0 for none.
    """
    return np.pad(reach, 1).view(np.uint8), np.pad(against, 1) if against.size else against


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
    from patrol.ground.kernels.ways import FAR, wave

    is_open, steps = framed(reach, against)
    width = is_open.shape[1]
    length = np.full(is_open.shape, FAR, dtype=np.int32)
    flat = np.array([(row + 1) * width + col + 1 for row, col in sorted(set(starts))], dtype=np.int64)
    wave(is_open, steps, flat, back, -1, limit, length, np.empty((2, is_open.size, 2), dtype=np.int32))
    return length


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
    from patrol.ground.kernels.ways import corners

    width = length.shape[1]
    begin, end = ((row + 1) * width + col + 1 for row, col in (first, last))
    way = np.empty(2, dtype=np.int32)
    count = corners(*framed(reach, against), begin, end, length, way)
    row, col = divmod(int(way[count - 1]), width)
    return row - 1, col - 1
