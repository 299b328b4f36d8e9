"""A short closed tour from which all of some ground is seen: what a fleet could do with one plan for all robots.

Robots that follow such a tour of length L at equal distances see each point at least once in L / (N v), so that time
bounds the MFoW that a fleet of N robots of speed v needs. The tour is the best that was found, not the shortest:
greedy choice of places, then 2-opt and Or-opt on their path lengths. It is the same for the same ground.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from patrol.ground.footprint import Footprint
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.ground.ways import framed, lengths_among
from patrol.kernels.tour import shorten
from patrol.kernels.ways import FAR, way_between
from patrol.tours.cover import Looks, Views, candidate_spacing, complete, cover_roughly
from patrol.tours.round import Flat, Tour

MOST_PLACES = 8_000
"""Places of the largest tour, which takes four minutes: those of 1 km2 for a sensor that sees 10 m far."""

NEAR = 6.0
"""Length of the paths that are searched for first, in distances of candidate places."""

SAMPLES = 0.25
"""Distance of the places on the way from which the ground is seen, as a share of the sensor's range."""

ROUNDS = 4
"""Largest number of times that places are put in order anew and the tour tightened."""

PULLS = (1.0, 0.5, 0.2)
"""Shares of the distance by which a place is pulled towards the middle of its neighbours."""

GAIN = 0.01
"""Least gain of a change to the tour, in distances of samples."""

NEIGHBOURS = 4
"""Places of a tour beside which a new one may be put in."""

PASSES = 8
"""Largest number of times that all places are tried in a row."""


def find_tour(
    terrain: Terrain, part: BoolGrid, ground: BoolGrid, proxy: NDArray[np.int32], footprint: Footprint
) -> Tour | None:
    """Find a short closed tour through a part of the reachable ground on which all of some ground is seen.

    The part is connected, and all of the ground can be seen from it by the sensor, which looks all around. `proxy`
    holds for a point of the ground outside of the part the flat index of a point of the part that sees it. None where
    more than `MOST_PLACES` are needed.
    """
    looks = Looks(terrain, footprint)
    exact = Views(looks, ground, 1)
    chosen, rough = cover_roughly(looks, ground, part, proxy, footprint)
    if len(chosen) > MOST_PLACES:
        return None
    ways = _Ways(part, max(SAMPLES * footprint.radius, 1.0), NEAR * candidate_spacing(part, footprint))
    best, length = chosen, math.inf
    for _ in range(ROUNDS):
        tour = _Patrol(ways.ordered(best), rough, ways)
        tour.complete(part, proxy)
        tour.tighten()
        if tour.length >= length:
            break
        best, length = tour.places, tour.length
    # The thinned grid may leave points unseen, which the exact one finds.
    tour = _Patrol(best, exact, ways)
    tour.complete(part, proxy)
    tour.tighten()
    return Tour(tour.length * terrain.point, tuple(looks.place(cell) for cell in tour.corners))


class _Ways:
    """Ways between the points of a part of the reachable ground, and tours in a short order."""

    def __init__(self, part: BoolGrid, stride: float, near: float) -> None:
        self._framed = framed(part)
        self.width = int(part.shape[1])
        self.stride = stride  # between samples on a way, points
        self._near = near  # longest path that is searched for first, points
        self._length = np.full(self._framed.shape, FAR, dtype=np.int32)
        self._queues = np.empty((2, self._framed.size, 2), dtype=np.int32)
        self._corners = np.empty(self._framed.size, dtype=np.int32)
        self._known: dict[tuple[int, int], tuple[float, tuple[int, ...]]] = {}
        self._bends: dict[tuple[int, int], tuple[int, ...]] = {}

    def inside(self, row: int, col: int) -> bool:
        """Return True if the body's centre may be on a point."""
        rows, cols = self._framed.shape
        return 0 <= row < rows - 2 and 0 <= col < cols - 2 and bool(self._framed[row + 1, col + 1])

    def way(self, first: int, last: int) -> tuple[float, tuple[int, ...]]:
        """Return the length of the way between two points, in points, and the samples on it, without its ends.

        It is the same in both directions.
        """
        pair = self._kept_pair(first, last)
        if pair not in self._known:
            begin, end = (self._flat_index(cell) for cell in pair)
            scratch = self._length, self._queues, self._corners
            count: int = way_between(self._framed, begin, end, *scratch)
            if not count:
                raise ValueError(f"no way leads from {first} to {last}")
            rows, cols = np.divmod(self._corners[:count].astype(np.int64), self._framed.shape[1])
            self._known[pair] = self._sample_way(rows - 1, cols - 1)
            self._bends[pair] = tuple(int(cell) for cell in (rows - 1) * self.width + cols - 1)
        return self._known[pair]

    def corners(self, first: int, last: int) -> tuple[int, ...]:
        """Return the corners of a way that is known, from its first point to before its last; flat indices."""
        if first == last:
            return (first,)
        pair = self._kept_pair(first, last)
        bends = self._bends[pair]
        return (bends if pair == (first, last) else bends[::-1])[:-1]

    def _kept_pair(self, first: int, last: int) -> tuple[int, int]:
        """Return the ends of the way that is kept for two points."""
        return (first, last) if first < last else (last, first)

    def _sample_way(self, rows: Flat, cols: Flat) -> tuple[float, tuple[int, ...]]:
        along = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(rows), np.diff(cols)))])
        samples = np.linspace(0.0, along[-1], math.ceil(along[-1] / self.stride) + 1)[1:-1]
        on_rows = np.floor(np.interp(samples, along, rows) + 0.5).astype(np.int64)
        on_cols = np.floor(np.interp(samples, along, cols) + 0.5).astype(np.int64)
        return float(along[-1]), tuple(int(cell) for cell in on_rows * self.width + on_cols)

    def _flat_index(self, place: int) -> int:
        row, col = divmod(place, self.width)
        return (row + 1) * (self.width + 2) + col + 1

    def ordered(self, places: list[int]) -> list[int]:
        """Return places in the order of a short closed tour."""
        if len(places) < 4:
            return places
        flat = np.array([self._flat_index(cell) for cell in places], dtype=np.int64)
        lengths = lengths_among(self._framed, flat, round(100.0 * self._near))
        tour = _nearest_neighbours(lengths)
        shorten(lengths, tour)
        return [places[index] for index in tour]

    def length(self, places: list[int]) -> float:
        """Return the length of the closed tour through some places, points."""
        return sum(self.way(places[index - 1], cell)[0] for index, cell in enumerate(places))


class _Patrol:
    """A closed tour and the ground that is seen on it; it becomes shorter while all ground is still seen."""

    def __init__(self, places: list[int], views: Views, ways: _Ways) -> None:
        self.places = list(places)  # in order
        self._views = views
        self._ways = ways
        views.clear()
        for index, cell in enumerate(self.places):
            views.add(cell)
            self._add_views(self.places[index - 1], cell)

    @property
    def length(self) -> float:
        """The length of the tour, points."""
        return self._ways.length(self.places)

    @property
    def corners(self) -> list[int]:
        """The corners of the tour in order, flat indices."""
        pairs = [(cell, self.places[(index + 1) % len(self.places)]) for index, cell in enumerate(self.places)]
        return [corner for pair in pairs for corner in self._ways.corners(*pair)]

    def complete(self, part: BoolGrid, proxy: NDArray[np.int32]) -> None:
        """Put in places until all is seen, each where it lengthens the tour least; see `find_tour`."""
        while added := complete(self._views, part, proxy):
            for cell in added:
                if cell in self.places:
                    self._views.take(cell)
                else:
                    self._insert_place(cell)

    def _insert_place(self, place: int) -> None:
        """Put in a place that is counted already."""
        if not self.places:
            self.places.append(place)
            return
        _, index = min(
            (self._detour_over(self.places[index - 1], place, self.places[index]), index)
            for index in self._places_beside(place)
        )
        before, after = self.places[index - 1], self.places[index]
        self.places.insert(index, place)
        self._add_views(before, place)
        self._add_views(place, after)
        for sample in self._ways.way(before, after)[1]:
            self._views.take(sample)

    def tighten(self) -> None:
        """Leave places out, and pull others closer to their neighbours, until nothing is gained."""
        for _ in range(PASSES):
            if not self.drop() + self._pull_places():
                break

    def drop(self) -> int:
        """Leave out places that are not needed, those first that save most; return how many."""
        saved = {
            place: self._detour_over(self.places[index - 1], place, self.places[(index + 1) % len(self.places)])
            for index, place in enumerate(self.places)
        }
        return sum(
            self._replace_place(self.places.index(place), [])
            for place in sorted(saved, key=lambda place: (-saved[place], place))
            if len(self.places) > 1
        )

    def _pull_places(self) -> int:
        """Move places towards the middle of their neighbours; return how many."""
        moved = 0
        width = self._ways.width
        for index in range(len(self.places)):
            row, col = divmod(self.places[index], width)
            (row0, col0), (row1, col1) = (
                divmod(self.places[(index + side) % len(self.places)], width) for side in (-1, 1)
            )
            for share in PULLS:
                to = round(row + share * (0.5 * (row0 + row1) - row)), round(col + share * (0.5 * (col0 + col1) - col))
                if self._ways.inside(*to) and self._replace_place(index, [to[0] * width + to[1]]):
                    moved += 1
                    break
        return moved

    def _replace_place(self, at: int, new: list[int]) -> bool:
        """Replace a place by another one or none, if the tour becomes shorter and still sees all; return True if so."""
        before, old, after = self.places[at - 1], self.places[at], self.places[(at + 1) % len(self.places)]
        if new == [old] or set(new) & set(self.places):
            return False
        now = [before, *new, after]
        length = sum(self._ways.way(*pair)[0] for pair in pairwise(now))
        # Less than a least gain would move places to and fro by rounding.
        if length > self._ways.way(before, old)[0] + self._ways.way(old, after)[0] - GAIN * self._ways.stride:
            return False
        added = [*new, *(sample for pair in pairwise(now) for sample in self._ways.way(*pair)[1])]
        removed = [old, *self._ways.way(before, old)[1], *self._ways.way(old, after)[1]]
        # All that is new first, so that ground which both see never counts as unseen.
        for cell in added:
            self._views.add(cell)
        for count, cell in enumerate(removed, start=1):
            if not self._views.take(cell):
                for back in removed[:count]:
                    self._views.add(back)
                for back in added:
                    self._views.take(back)
                return False
        self.places[at : at + 1] = new
        return True

    def _places_beside(self, place: int) -> list[int]:
        """Return the numbers of the places next to the `NEIGHBOURS` that are nearest to a point in a straight line."""
        rows, cols = np.divmod(np.array(self.places), self._ways.width)
        row, col = divmod(place, self._ways.width)
        nearest = np.argsort((rows - row) ** 2 + (cols - col) ** 2, kind="stable")[:NEIGHBOURS]
        return sorted({int(index + side) % len(self.places) for index in nearest for side in (0, 1)})

    def _detour_over(self, before: int, place: int, after: int) -> float:
        """Return the detour over a place between two others, points."""
        way = self._ways.way
        return way(before, place)[0] + way(place, after)[0] - way(before, after)[0]

    def _add_views(self, first: int, last: int) -> None:
        for sample in self._ways.way(first, last)[1]:
            self._views.add(sample)


def _nearest_neighbours(lengths: NDArray[np.int32]) -> Flat:
    """Return a first tour: from place 0 always on to the nearest place that is left."""
    unvisited = np.ones(len(lengths), dtype=np.bool_)
    tour = np.zeros(len(lengths), dtype=np.int64)
    for step in range(1, len(tour)):
        unvisited[tour[step - 1]] = False
        tour[step] = np.argmin(np.where(unvisited, lengths[tour[step - 1]], FAR))
    return tour
