"""Ways over the ground, which lead against no one-way zone: their lengths, and where they first bend.

Their kernels are loaded where they are used, as few processes need them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from patrol.ground.terrain import BoolGrid, Steps


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
