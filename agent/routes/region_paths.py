"""The region method: straight within a region, and through connecting points from one region to the next (paper)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.kernels.region_paths import last_legs, route
from agent.kernels.wave import FAR, SETTLED, STATUS
from agent.routes.ground import Ground
from agent.routes.path_window import Lengths, PathWindow, Place

if TYPE_CHECKING:
    from patrol.regions.split import RegionSplit

Ints = NDArray[np.int32]


class Regions(PathWindow):
    """Shortest paths through connecting points.

    Their length is L(R, T) = rho(R, CP_1) + rho(CP_1, CP_2) + ... + rho(CP_n, T). The first bend is the first
    connecting point, or the target where the path needs none, so that directions are continuous. A robot on a
    connecting point is in both of its regions.
    """

    def __init__(self, height: int, width: int, span: int, split: RegionSplit) -> None:
        """Allocate the window and build the graph of connections."""
        super().__init__(height, width, span)
        links = split.connections
        self._parts = split.parts
        self._graph = _Graph.of([link.points[0] for link in links], [link.parts for link in links], split.parts)
        self._sources = _Sources.room(self._graph, 0)

    def _prepare_memory(self) -> None:
        self._route_connections([(self.start_row, self.start_col)])

    def extend(self, limit: int) -> None:
        """Settle every path up to ``limit`` hundredths of a point."""
        span = min(self.span, -(-limit // 100))
        rows, cols = self.state.shape
        top, bottom = max(0, self.start_row - span), min(rows, self.start_row + span + 1)
        left, right = max(0, self.start_col - span), min(cols, self.start_col + span + 1)
        self._settle_box(top, bottom, left, right, limit)

    def lengths_from(self, ground: Ground, row: int, col: int, starts: Sequence[Place], limit: int) -> Lengths:
        """Find lengths as `PathWindow.lengths_from`, from all starts at once."""
        self._place_window(ground, row, col)
        inside = [(r - self.row0 - 1, c - self.col0 - 1) for r, c in starts]
        self._route_connections([start for start in sorted(set(inside)) if self._holds_point(*start)])
        self._settle_box(0, self.state.shape[0], 0, self.state.shape[1], limit)
        return np.where(self.state & STATUS == SETTLED, self.length, FAR)

    def _route_connections(self, starts: Sequence[Place]) -> None:
        """Find the shortest ways from the nearest of some elements of the window to all connections."""
        graph = self._graph
        placed = []
        for row, col in ((row + self.row0, col + self.col0) for row, col in starts):
            own_part = int(self._parts[row, col])
            if own_part < 0:
                continue
            here = graph.members[graph.first[own_part] : graph.first[own_part + 1]]
            here = here[(graph.places[here] == (row, col)).all(axis=1)]
            placed += [(row, col, part) for part in sorted({own_part, *map(int, graph.joined[here].ravel())})]
        start = np.array(placed, dtype=np.int32).reshape(-1, 3)
        rows, cols, parts = (np.ascontiguousarray(column) for column in start.T)
        self._sources = _Sources.room(graph, len(start))
        count = len(graph.places)
        lead, came, heap, slots = (np.empty(count, dtype=np.int32) for _ in range(4))
        limit = float(self.span)
        route(rows, cols, parts, *graph, limit, np.empty(count), lead, came, heap, slots, *self._sources)

    def _settle_box(self, top: int, bottom: int, left: int, right: int, limit: int) -> None:
        box = (self.row0, self.col0, top, bottom, left, right)
        last_legs(self.state, self.length, self.bend, self._parts, self._graph.places, *box, limit, *self._sources)


class _Graph(NamedTuple):
    """Connections and parts: see `agent.kernels.region_paths.route`."""

    places: Ints
    joined: Ints
    first: Ints
    members: Ints

    @staticmethod
    def of(points: Sequence[int], joined: Sequence[tuple[int, int]], parts: Ints) -> _Graph:
        """Build the graph from each connection's point, a flat index, and the two parts that it joins.

        `parts` is int32 (h, w), -1 for points without a part.
        """
        places = np.stack(np.divmod(np.array(points, dtype=np.int32), parts.shape[1]), axis=1)
        ends = np.array(joined, dtype=np.int32).reshape(-1, 2)
        members = np.argsort(ends.reshape(-1), kind="stable") // 2
        sizes = np.bincount(ends.reshape(-1), minlength=int(parts.max(initial=-1)) + 1)
        first = np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(sizes)])
        return _Graph(np.ascontiguousarray(places), ends, first.astype(np.int32), members.astype(np.int32))


class _Sources(NamedTuple):
    """The places where the last legs begin: see `agent.kernels.region_paths.route`."""

    begin: Ints
    row: Ints
    col: Ints
    away: NDArray[np.float64]
    lead: Ints

    @staticmethod
    def room(graph: _Graph, starts: int) -> _Sources:
        """Allocate room for the largest possible number of sources."""
        count = 2 * len(graph.places) + starts
        row, col, lead = (np.empty(count, dtype=np.int32) for _ in range(3))
        return _Sources(np.zeros(len(graph.first), dtype=np.int32), row, col, np.empty(count), lead)
