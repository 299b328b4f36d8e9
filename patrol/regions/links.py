"""Connections: points at which a body passes from one region to the next (paper: connecting points)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from patrol.ground.terrain import BoolGrid, Terrain
from patrol.kernels.regions import split_parts

Ints = NDArray[np.int32]

GAP = 2.0
"""Places on a border further apart than this, in points, belong to separate stretches."""


@dataclass(frozen=True, slots=True)
class Connection:
    """A place where a body passes from one region to another."""

    x: float  # m, centre of the first of `points`
    y: float  # m
    regions: tuple[int, int]
    parts: tuple[int, int]  # numbers of the two parts of regions
    points: tuple[int, int]  # flat indices of the neighbouring points on either side


def connect(terrain: Terrain, labels: Ints, body: BoolGrid) -> tuple[Ints, tuple[Connection, ...]]:
    """Return the parts of regions in which a body's centre may be, and the connections between them.

    Parts are int32 (h, w), -1 where the centre may not be; `labels` has region numbers, -1 for none. There is one
    connection in the middle of each stretch of border that the body can pass, in the order of the parts.
    """
    parts = np.empty(labels.shape, dtype=np.int32)
    work = np.empty(labels.size, dtype=np.int32)
    split_parts(np.ascontiguousarray(body).view(np.uint8), np.ascontiguousarray(labels), parts, work)
    low, high = _border_points(parts)
    flat = parts.ravel()
    pairs = np.stack([flat[low], flat[high]], axis=1)
    order = np.lexsort((high, low, pairs[:, 1], pairs[:, 0]))
    low, high, pairs = low[order], high[order], pairs[order]
    starts = np.flatnonzero((np.diff(pairs, axis=0, prepend=-1) != 0).any(axis=1))
    connections = []
    for start, stop in pairwise([*map(int, starts), low.size]):
        for index in _border_middles(low[start:stop], high[start:stop], terrain.width):
            first, second = int(low[start + index]), int(high[start + index])
            x, y = terrain.centre(*divmod(first, terrain.width))
            regions = (int(labels.flat[first]), int(labels.flat[second]))
            connections.append(Connection(x, y, regions, (int(flat[first]), int(flat[second])), (first, second)))
    parts.flags.writeable = False
    return parts, tuple(connections)


def _border_points(parts: Ints) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Flat indices of the neighbouring points that lie in two parts, that of the lower part first."""
    index = np.arange(parts.size, dtype=np.int64).reshape(parts.shape)
    sides = [
        (parts[:, :-1], parts[:, 1:], index[:, :-1], index[:, 1:]),
        (parts[:-1], parts[1:], index[:-1], index[1:]),
    ]
    ends = []
    for region, neighbour, at_one, at_two in sides:
        apart = (region >= 0) & (neighbour >= 0) & (region != neighbour)
        ends.append(np.stack([at_one[apart], at_two[apart]], axis=1))
    joined = np.concatenate(ends)
    swapped = parts.ravel()[joined[:, 0]] > parts.ravel()[joined[:, 1]]
    joined[swapped] = joined[swapped][:, ::-1]
    return joined[:, 0], joined[:, 1]


def _border_middles(first: NDArray[np.int64], second: NDArray[np.int64], width: int) -> list[int]:
    """Return the index of the middle pair of points of each stretch of the border between two parts."""
    places = 0.5 * (np.stack(np.divmod(first, width), axis=1) + np.stack(np.divmod(second, width), axis=1))
    # Two convex regions meet along a straight line, so places are in order along the way from one end to the other.
    end = places[np.argmax(np.hypot(*(places - places[0]).T))]
    way = places[np.argmax(np.hypot(*(places - end).T))] - end
    along = (places - end) @ (way / max(float(np.hypot(*way)), 1.0))
    order = np.argsort(along, kind="stable")
    stretches = np.split(order, np.flatnonzero(np.diff(along[order]) > GAP) + 1)
    middles = []
    for stretch in stretches:
        middle = 0.5 * (along[stretch[0]] + along[stretch[-1]])
        middles.append(int(stretch[np.argmin(np.abs(along[stretch] - middle))]))
    return middles
