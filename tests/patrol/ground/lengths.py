"""Lengths of ways from the nearest of several points, for tests of the kernel that finds them and of rounds."""

import numpy as np
from numpy.typing import NDArray

from patrol.ground.terrain import BoolGrid
from patrol.ground.ways import framed
from patrol.kernels.ways import FAR, wave


def lengths_along(reach: BoolGrid, starts: list[tuple[int, int]], limit: int) -> NDArray[np.int32]:
    """Return the lengths of the ways from the nearest of several points.

    The result is int32 (height + 2, width + 2), framed by one point on every side, in hundredths of a point as is
    `limit`, the longest way; `FAR` where no way leads. The starts are rows and columns without the frame.
    """
    is_open = framed(reach)
    width = is_open.shape[1]
    length = np.full(is_open.shape, FAR, dtype=np.int32)
    # Without duplicates, which the kernel does not allow, and shifted by the frame.
    flat = np.array([(row + 1) * width + col + 1 for row, col in sorted(set(starts))], dtype=np.int64)
    wave(is_open, flat, -1, limit, length, np.empty((2, is_open.size, 2), dtype=np.int32))
    return length
