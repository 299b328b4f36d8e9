"""A graph made from the ground, for terrains that come without one, and short tours through vertices of a graph.

The vertices are places from which all of the ground is seen, as few as a greedy choice finds; so robots that visit all
of them see everything. Two are neighbours where no third one is nearer to both of them, by the ways between them (the
relative neighbourhood graph), which keeps the graph connected where the ground is, and its ways short.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from patrol.graph import Graph, graph_of
from patrol.ground.fields import StaticFields
from patrol.ground.footprint import Footprint
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.kernels.components import label_parts
from patrol.kernels.tour import shorten
from patrol.kernels.ways import FAR, lengths_between
from patrol.tours.cover import Looks, Views, choose, complete, lattice, needed

SPACING = 0.4
"""Distance of the candidate places, as a share of the sensor's range."""

MOST_CANDIDATES = 6000
"""Candidate places at most: on larger ground they lie farther apart."""

ROUGH = 50.0
"""Points of a thinned grid along the sensor's range, by which places are chosen."""

NEAR = 4.0
"""Length of the ways that are searched for first, in sensor ranges."""

Flat = NDArray[np.int64]


def on_reach(graph: Graph, terrain: Terrain, reach: BoolGrid) -> Graph:
    """Return a graph whose vertices a body can stand on: the others move to the nearest place where it can.

    The edges keep their lengths.
    """
    rows, cols = np.nonzero(reach)
    x, y = terrain.origin
    across, up = x + (cols + 0.5) * terrain.point, y + (rows + 0.5) * terrain.point
    places = graph.places.copy()
    for vertex, (vertex_x, high) in enumerate(graph.places.tolist()):
        row, col = terrain.point_at(vertex_x, high)
        if not terrain.inside(row, col) or not reach[row, col]:
            nearest = int(np.argmin((across - vertex_x) ** 2 + (up - high) ** 2))
            places[vertex] = across[nearest], up[nearest]
    return Graph(places, graph.edges, graph.pixel, graph.visit)


def graph_from_ground(terrain: Terrain, fields: StaticFields, footprint: Footprint) -> Graph:
    """Make the graph of the ground of one kind of body."""
    part = np.asarray(fields.reach)
    spacing = max(SPACING * footprint.radius, math.sqrt(np.count_nonzero(part) / MOST_CANDIDATES), 1.0)
    looks = Looks(terrain, footprint)
    views = Views(looks, fields.patrolled, max(round(footprint.radius / ROUGH), 1))
    chosen = needed(choose(lattice(part, spacing), views) + complete(views, part, fields.proxy), views)
    exact = Views(looks, fields.patrolled, 1)
    for cell in chosen:
        exact.add(cell)
    places = sorted(needed(chosen + complete(exact, part, fields.proxy), exact))
    rows, cols = np.divmod(np.array(places, dtype=np.int64), terrain.width)
    lengths = _way_lengths(part, rows, cols, NEAR * footprint.radius)
    edges = []
    for first in range(len(places)):
        for last in range(first + 1, len(places)):
            way = lengths[first, last]
            if way < FAR and not (np.maximum(lengths[first], lengths[last]) < way).any():
                edges.append((first, last, float(way) * terrain.point / 100.0))
    return graph_of([terrain.centre(int(row), int(col)) for row, col in zip(rows, cols, strict=True)], edges)


def _way_lengths(part: BoolGrid, rows: Flat, cols: Flat, near: float) -> NDArray[np.int32]:
    """Compute the lengths of the ways between places, int32 (v, v), in hundredths of a point; `FAR` without a way.

    Ways are searched for up to a length first. A longer one leads through other places then, which does not matter:
    places that have another one in between are no neighbours.
    """
    framed = np.pad(part, 1).view(np.uint8)
    lengths = np.empty((rows.size, rows.size), dtype=np.int32)
    places = (rows + 1) * framed.shape[1] + cols + 1
    labels = np.empty(framed.shape, dtype=np.int32)
    label_parts(framed, labels, np.empty(framed.size, dtype=np.int32))
    of_part = np.bincount(labels.reshape(-1)[places])
    apart = rows.size**2 - int((of_part**2).sum())
    limit = min(round(100.0 * near), FAR // 2)
    while lengths_between(framed, places, limit, lengths) > apart:
        limit = min(4 * limit, FAR // 2)
    return lengths


STARTS = 6
"""Number of tours that are shortened, each from another vertex on; the shortest is taken."""


def closed_tour(graph: Graph, vertices: Iterable[int]) -> list[int]:
    """Find a short closed tour through some vertices, by the ways of the graph; it begins with the least.

    From several vertices on, the nearest one comes next; then 2-opt and Or-opt shorten the tour. Vertices that no way
    leads to from the first one are left out. There must be at least one.
    """
    every = sorted(set(vertices))
    reachable = [vertex for vertex in every if graph.lengths[every[0], vertex] < np.inf]
    lengths = np.rint(1000.0 * graph.lengths[np.ix_(reachable, reachable)]).astype(np.int32)
    best, shortest = list(range(len(reachable))), None
    for begin in np.linspace(0, len(reachable) - 1, min(STARTS, len(reachable))).astype(int).tolist():
        tour, remaining = [begin], set(range(len(reachable))) - {begin}
        while remaining:
            tour.append(min(remaining, key=lambda vertex: (int(lengths[tour[-1], vertex]), vertex)))
            remaining.remove(tour[-1])
        order = np.array(tour, dtype=np.int64)
        length = int(shorten(lengths, order))
        if shortest is None or length < shortest:
            best, shortest = order.tolist(), length
    first = best.index(0)
    return [reachable[index] for index in best[first:] + best[:first]]


def tour_length(graph: Graph, tour: list[int]) -> float:
    """Return the length of a closed tour, m."""
    return sum(float(graph.lengths[tour[index - 1], vertex]) for index, vertex in enumerate(tour))
