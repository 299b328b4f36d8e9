"""A graph of places with the lengths of the ways between neighbours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

VISIT_M = 0.4
"""Distance within which a robot visits a place unless told otherwise, m: the goal tolerance of patrolling_sim."""

PIXEL = 0.075
"""Side of a pixel where no image says it, m: that of patrolling_sim's maps cumberland and grid."""


@dataclass(frozen=True, eq=False)
class Graph:
    """A graph without loops; ways lead in both directions."""

    places: NDArray[np.float64]  # (v, 2), x and y of each vertex, m
    # by vertex: neighbours with the length of the way there, m, in the file's order
    edges: tuple[tuple[tuple[int, float], ...], ...]
    pixel: float = PIXEL  # side of its image's pixels, m, in which rules of the literature count
    visit: float = VISIT_M  # distance within which a robot visits a vertex, m

    @property
    def size(self) -> int:
        """Number of vertices."""
        return len(self.edges)

    @cached_property
    def lengths(self) -> NDArray[np.float64]:
        """float64 (v, v), lengths of the shortest ways between vertices, m (Floyd and Warshall)."""
        lengths = np.full((self.size, self.size), np.inf)
        np.fill_diagonal(lengths, 0.0)
        for vertex, neighbours in enumerate(self.edges):
            for other, length in neighbours:
                lengths[vertex, other] = min(lengths[vertex, other], length)
        for by in range(self.size):
            np.minimum(lengths, lengths[:, by, None] + lengths[None, by, :], out=lengths)
        lengths.flags.writeable = False
        return lengths

    @cached_property
    def hops(self) -> NDArray[np.float64]:
        """float64 (v, v), the least number of edges between vertices; infinity without a way."""
        return Graph(self.places, tuple(tuple((other, 1.0) for other, _ in row) for row in self.edges)).lengths

    def step(self, vertex: int, goal: int) -> int:
        """Return the next vertex on the shortest way to a goal; the goal itself when it is there already."""
        if vertex == goal:
            return vertex
        return min((length + float(self.lengths[other, goal]), other) for other, length in self.edges[vertex])[1]

    def way(self, vertex: int, goal: int) -> list[int]:
        """Return the vertices on the shortest way to a goal, without the first one and with the goal.

        The list is empty where both are one; otherwise a way must lead to the goal.
        """
        way: list[int] = []
        while vertex != goal:
            vertex = self.step(vertex, goal)
            way.append(vertex)
        return way

    def nearest(self, x: float, y: float) -> int:
        """Return the vertex that is nearest to a place as the crow flies."""
        return int(np.argmin(((self.places - (x, y)) ** 2).sum(axis=1)))

    def visit_reach(self, speed: float, step: float) -> float:
        """Return the distance (m) within which a robot of some speed (m/s) visits a vertex.

        It is `visit`, or half of what the robot drives in a tick of `step` s where that is more.
        """
        return max(self.visit, 0.5 * speed * step)

    def within(self, first: tuple[float, float], last: tuple[float, float], reach: float) -> list[int]:
        """Return the vertices no farther than `reach` (m) from a straight stretch, in order along it.

        Its very beginning does not count: a robot that leaves a vertex does not visit it anew.
        """
        begin, way = np.array(first), np.subtract(last, first)
        along = np.clip((self.places - begin) @ way / max(float(way @ way), 1e-12), 0.0, 1.0)
        off = self.places - begin - along[:, None] * way
        at_end = ((self.places - last) ** 2).sum(axis=1) <= reach * reach
        beside = np.flatnonzero(at_end | ((off**2).sum(axis=1) <= reach * reach) & (along > 0.0))
        return [int(vertex) for vertex in beside[np.argsort(along[beside], kind="stable")]]


def graph_of(
    places: Sequence[tuple[float, float]],
    edges: Sequence[tuple[int, int, float]],
    pixel: float = PIXEL,
    visit: float = VISIT_M,
) -> Graph:
    """Make a graph from its vertices and its edges, each named once.

    A place is x and y in m. An edge is two vertices and the length of the way between them in m.
    """
    rows: list[list[tuple[int, float]]] = [[] for _ in places]
    for first, last, length in edges:
        rows[first].append((last, length))
        rows[last].append((first, length))
    return Graph(np.array(places, dtype=np.float64).reshape(-1, 2), tuple(map(tuple, rows)), pixel, visit)
