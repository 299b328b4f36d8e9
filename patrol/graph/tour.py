"""A short closed tour through vertices of a graph."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from patrol.graph.graph import Graph
from patrol.ground.kernels.tour import shorten

STARTS = 6
"""Number of tours that are shortened, each from another vertex on; the shortest is taken."""


def closed_tour(graph: Graph, vertices: Iterable[int]) -> list[int]:
    """Find a short closed tour through some vertices, by the ways of the graph; it begins with the least.

    From several vertices on, the nearest one comes next; then 2-opt and Or-opt shorten the tour. Vertices that no way
    leads to from the first one are left out. There must be at least one.
    """
    every = sorted(set(vertices))
    there = [vertex for vertex in every if graph.lengths[every[0], vertex] < np.inf]
    lengths = np.rint(1000.0 * graph.lengths[np.ix_(there, there)]).astype(np.int32)
    best, shortest = list(range(len(there))), None
    for begin in np.linspace(0, len(there) - 1, min(STARTS, len(there))).astype(int).tolist():
        tour, left = [begin], set(range(len(there))) - {begin}
        while left:
            tour.append(min(left, key=lambda vertex: (int(lengths[tour[-1], vertex]), vertex)))
            left.remove(tour[-1])
        order = np.array(tour, dtype=np.int64)
        length = int(shorten(lengths, order))
        if shortest is None or length < shortest:
            best, shortest = order.tolist(), length
    first = best.index(0)
    return [there[at] for at in best[first:] + best[:first]]


def tour_length(graph: Graph, tour: list[int]) -> float:
    """Return the length of a closed tour, m."""
    return sum(float(graph.lengths[tour[at - 1], vertex]) for at, vertex in enumerate(tour))
