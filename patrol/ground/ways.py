"""Lengths of ways over the ground.

A way is a row of steps to neighbouring points. The kernels of ways are loaded where they are used, as few processes
need them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from patrol.ground.terrain import BoolGrid


def framed(reach: BoolGrid) -> NDArray[np.uint8]:
    """Return the ground as the kernels of ways take it: uint8, framed by one point on every side.

    It is 1 where a body's centre may be.
    """
    return np.pad(reach, 1).view(np.uint8)


def lengths_among(is_open: NDArray[np.uint8], places: NDArray[np.int64], limit: int) -> NDArray[np.int32]:
    """Return the lengths of the ways from each to each of some places, int32 (n, n), in hundredths of a point.

    `FAR` where no way leads. The places are flat indices of ground as of `framed`, all different. Ways are searched for
    up to `limit` first; a longer one may lead through other places, and then be a little longer than the shortest.
    """
    from patrol.kernels.clearance import label_parts
    from patrol.kernels.ways import FAR, lengths_between

    labels = np.empty(is_open.shape, dtype=np.int32)
    label_parts(is_open, labels, np.empty(is_open.size, dtype=np.int32))
    of_part = np.bincount(labels.reshape(-1)[places])
    apart = places.size**2 - int((of_part**2).sum())  # pairs in different parts
    lengths = np.empty((places.size, places.size), dtype=np.int32)
    limit = min(limit, FAR // 2)
    while lengths_between(is_open, places, limit, lengths) > apart and limit < FAR // 2:
        limit = min(2 * limit, FAR // 2)
    return lengths
