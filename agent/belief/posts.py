"""Posts: the places from which points are seen that no body reaches."""

from __future__ import annotations

from copy import copy

import numpy as np
from numpy.typing import NDArray


class Posts:
    """The patrolled points on which no body fits, each with its post: the nearest reachable point that sees it.

    `rows`, int32 (n, 4) and read-only, holds the row and column of each point, then those of its post; it is sorted by
    post, row by row. `gap` is the largest number of rows, or of columns, between a point and its post.
    """

    def __init__(self, proxy: NDArray[np.int32]) -> None:
        """Sort the points by post, from `StaticFields.proxy`: int32 (h, w), flat indices of posts, -1 for none."""
        self.move(proxy)

    def own(self) -> Posts:
        """Return posts of a robot's own, which share all grids with these until they move."""
        own = copy(self)
        own._stands = self.stands
        return own

    def move(self, proxy: NDArray[np.int32]) -> None:
        """Take other posts, for ground on which something is believed blocked."""
        self._proxy = proxy
        self._stands: NDArray[np.int64] | None = None
        width = proxy.shape[1]
        points = np.flatnonzero(proxy.reshape(-1) >= 0)
        posts = proxy.reshape(-1)[points]
        # Flat indices ascend row by row, so the entries of a range of rows lie side by side.
        order = np.argsort(posts, kind="stable")
        columns = (*np.divmod(points[order], width), *np.divmod(posts[order], width))
        self._rows: NDArray[np.int32] = np.ascontiguousarray(np.stack(columns, axis=1).astype(np.int32))
        # Kernels index grids by them and do not check bounds.
        self.rows = self._rows.view()
        self.rows.flags.writeable = False
        self.gap = int(np.abs(self.rows[:, :2] - self.rows[:, 2:]).max(initial=0))
        per_row = np.bincount(self.rows[:, 2], minlength=proxy.shape[0])
        self._ends: list[int] = [0, *per_row.cumsum().tolist()]

    @property
    def stands(self) -> NDArray[np.int64]:
        """int64 (h, w), read-only: flat index of each point's post, or of the point itself where it has none."""
        if self._stands is None:
            cells = np.arange(self._proxy.size).reshape(self._proxy.shape)
            self._stands = np.where(self._proxy < 0, cells, self._proxy)
            self._stands.flags.writeable = False
        return self._stands

    def between(self, first: int, last: int) -> NDArray[np.int32]:
        """Return the entries of `rows` whose post lies in the rows from `first` to `last`, both inclusive.

        Both may lie outside the terrain.

        For example, `between(0, 0)` has the points whose post lies in row 0.
        """
        height = len(self._ends) - 1
        return self._rows[self._ends[min(max(first, 0), height)] : self._ends[min(max(last + 1, 0), height)]]
