"""The choice of places from which all of some ground is seen: the beginning of a tour."""

from __future__ import annotations

import heapq
import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from patrol.ground.footprint import Footprint
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.pose import Pose

SPACING = 0.4
"""Distance of the candidate places, as a share of the sensor's range."""

MOST_CANDIDATES = 6000
"""Candidate places at most: on larger ground they lie farther apart."""

ROUGH = 50.0
"""Points of the thinned grid of `cover_roughly` along the sensor's range."""

HEADINGS = tuple(math.remainder(number * math.tau / 16, math.tau) for number in range(16))
"""The headings in which a robot looks whose sensor does not look all round, rad."""

ASKEW = 0.1
"""By so much a robot may face beside a heading to either side, rad."""

REMEMBERED = 512
"""Views kept at most, for the whole grid; more for a thinned one."""


class Looks:
    """The views from points, remembered for a while."""

    def __init__(self, terrain: Terrain, footprint: Footprint) -> None:
        self._terrain = terrain
        self._footprint = footprint

    def place(self, place: int) -> tuple[float, float]:
        """Return x and y of a point's centre, m."""
        return self._terrain.centre(*divmod(place, self._terrain.width))

    def window(self, place: int, every: int, heading: float | None = None) -> tuple[slice, slice, BoolGrid]:
        """Return rows and columns of a thinned grid around a place, and which of its points are seen from there.

        The grid holds every so many points of each row and column. Without a heading, in rad, a robot looks all round,
        if need be by turning on the spot.
        """
        x, y = self.place(place)
        view = self._footprint.visible(Pose(x, y, 0.0))
        seen = view.mask
        if not self._footprint.all_round:
            headings = HEADINGS if heading is None else (heading - ASKEW, heading + ASKEW)
            masks = [self._footprint.visible(Pose(x, y, angle)).mask for angle in headings]
            seen = np.logical_or.reduce(masks) if heading is None else np.logical_and.reduce(masks)
        top, left = max(0, -(-view.row0 // every)), max(0, -(-view.col0 // every))
        mask = seen[top * every - view.row0 :: every, left * every - view.col0 :: every]
        height, width = (-(-size // every) for size in self._terrain.shape)
        mask = mask[: height - top, : width - left] != 0
        return slice(top, top + mask.shape[0]), slice(left, left + mask.shape[1]), mask


class Views:
    """Counts of the chosen places that see each point of some ground, in a thinned grid as of `Looks.window`."""

    def __init__(self, looks: Looks, ground: BoolGrid, every: int) -> None:
        """Begin with no chosen place."""
        self.ground = ground[::every, ::every].copy()
        self.count: NDArray[np.int32] = np.zeros(self.ground.shape, dtype=np.int32)
        self._every = every
        self._width = ground.shape[1]
        self._looks = looks
        self._window = lru_cache(maxsize=REMEMBERED * every * every)(self._look_from)

    def clear(self) -> None:
        """Begin anew, with no chosen place."""
        self.count[:] = 0

    def _look_from(self, place: int) -> tuple[slice, slice, BoolGrid]:
        rows, cols, mask = self._looks.window(place, self._every)
        return rows, cols, mask & self.ground[rows, cols]

    def gain(self, place: int) -> int:
        """Count the points that are seen from a place and from no chosen one."""
        rows, cols, mask = self._window(place)
        return int(np.count_nonzero(mask & (self.count[rows, cols] == 0)))

    def add(self, place: int) -> None:
        """Count what is seen from a place."""
        rows, cols, mask = self._window(place)
        self.count[rows, cols] += mask

    def take(self, place: int) -> bool:
        """Take a chosen place back; return True if all that is seen from it is still seen from another one."""
        rows, cols, mask = self._window(place)
        count = self.count[rows, cols]
        count -= mask
        return not (mask & (count == 0)).any()

    def unseen(self) -> int | None:
        """Return the first point of the ground, a flat index, that is seen from no chosen place; None without one."""
        missing = self.ground & (self.count == 0)
        index = int(missing.argmax())
        row, col = divmod(index, missing.shape[1])
        return row * self._every * self._width + col * self._every if missing[row, col] else None

    def forget(self, point: int) -> None:
        """Leave a point out of the ground."""
        row, col = divmod(point, self._width)
        self.ground[row // self._every, col // self._every] = False


def candidate_spacing(part: BoolGrid, footprint: Footprint) -> float:
    """Return the distance of the candidate places on a part of the ground, in points."""
    return max(SPACING * footprint.radius, math.sqrt(np.count_nonzero(part) / MOST_CANDIDATES), 1.0)


def cover_roughly(
    looks: Looks, ground: BoolGrid, part: BoolGrid, proxy: NDArray[np.int32], footprint: Footprint
) -> tuple[list[int], Views]:
    """Choose places of a part that see all of some ground in a thinned grid; return them and their views.

    `proxy` is as for `patrol.tours.search.find_tour`.
    """
    views = Views(looks, ground, max(round(footprint.radius / ROUGH), 1))
    candidates = lattice(part, candidate_spacing(part, footprint))
    return needed(choose(candidates, views) + complete(views, part, proxy), views), views


def lattice(part: BoolGrid, spacing: float) -> list[int]:
    """Return one point of a part for each square of a lattice, the nearest to its centre; spacing in points."""
    inside = np.flatnonzero(part)
    rows, cols = np.divmod(inside, part.shape[1])
    row, col = (rows / spacing).astype(np.int64), (cols / spacing).astype(np.int64)
    off = (rows - (row + 0.5) * spacing) ** 2 + (cols - (col + 0.5) * spacing) ** 2
    order = np.lexsort((off, col, row))
    square = (row * part.shape[1] + col)[order]
    first = np.ones(len(order), dtype=np.bool_)
    first[1:] = square[1:] != square[:-1]
    return [int(cell) for cell in inside[order[first]]]


def choose(candidates: list[int], views: Views) -> list[int]:
    """Choose places greedily: always the one that adds most, until none adds anything."""
    waiting = [(-views.gain(cell), cell) for cell in candidates]
    heapq.heapify(waiting)
    chosen = []
    while waiting:
        gain, cell = heapq.heappop(waiting)
        now = views.gain(cell)  # at most what it was when it was put in
        if now == -gain:
            if now == 0:
                break
            views.add(cell)
            chosen.append(cell)
        elif now:
            heapq.heappush(waiting, (-now, cell))
    return chosen


def complete(views: Views, part: BoolGrid, proxy: NDArray[np.int32]) -> list[int]:
    """Add and return places for what no candidate sees: the unseen point, or the point of the part that sees it."""
    inside, posts = part.reshape(-1), proxy.reshape(-1)
    added = []
    while (here := views.unseen()) is not None:
        cell = here if inside[here] else int(posts[here])
        if not views.gain(cell):  # `here` is seen from nowhere in this part
            views.forget(here)
            continue
        views.add(cell)
        added.append(cell)
    return added


def needed(chosen: list[int], views: Views) -> list[int]:
    """Return the chosen places without those that see nothing alone."""
    needed = []
    for cell in dict.fromkeys(chosen):
        if not views.take(cell):
            views.add(cell)
            needed.append(cell)
    return needed
