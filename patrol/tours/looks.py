"""Looks aside on a tour, for a sensor that does not look all round.

While a robot drives along a tour it sees what lies ahead. The rest is seen from places on the tour where it turns on
the spot: *looks*. They are chosen greedily, those first that show most for the turn that they take.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import replace
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from patrol.tours.cover import HEADINGS, Looks
from patrol.tours.round import Tour, places_of

if TYPE_CHECKING:
    from patrol.ground.footprint import Footprint
    from patrol.ground.terrain import BoolGrid, Terrain

SPACING = 0.1
"""Distance of the places from which a robot may look aside, as a share of the sensor's range."""

LOOK = 1.0
"""Price of a look, in rad of turns."""


def with_looks(tour: Tour, terrain: Terrain, part: BoolGrid, ground: BoolGrid, footprint: Footprint) -> Tour:
    """Return a tour with looks, so that all of the ground is seen that a robot on it sees by turning on the spot.

    `part` marks where the body's centre may be.
    """
    looks, spacing = Looks(terrain, footprint), max(SPACING * footprint.range_m, terrain.point)
    places, along, ahead, _ = places_of(terrain, part, tour, spacing)
    unseen = ground.copy()

    def count(index: int, heading: float) -> int:
        """Count the unseen points that a look shows."""
        rows, cols, mask = looks.window(int(places[index]), 1, heading)
        return int(np.count_nonzero(mask & unseen[rows, cols]))

    def take(index: int, heading: float) -> None:
        rows, cols, mask = looks.window(int(places[index]), 1, heading)
        unseen[rows, cols] &= ~mask

    for index, heading in enumerate(ahead.tolist()):
        take(index, heading)
    waiting = []
    for index, driven in enumerate(ahead.tolist()):
        for heading in HEADINGS:
            if shown := count(index, heading):
                price = LOOK + abs(math.remainder(heading - driven, math.tau))
                waiting.append((-shown / price, index, heading, price))
    heapq.heapify(waiting)
    chosen = []
    while waiting:
        worth, index, heading, price = heapq.heappop(waiting)
        now = -count(index, heading) / price  # at best what it was when it was put in
        if now == worth:
            take(index, heading)
            chosen.append((index, math.remainder(heading - ahead[index], math.tau)))
        elif now:
            heapq.heappush(waiting, (now, index, heading, price))
    chosen.sort()
    headings = [math.remainder(float(ahead[index]) + turn, math.tau) for index, turn in chosen]
    at_m = [float(along[index]) for index, _ in chosen]
    return replace(tour, looks=tuple(zip(at_m, headings, strict=True)), turned=sum(_turns(chosen)))


def _turns(chosen: list[tuple[int, float]]) -> list[float]:
    """Return by how much a robot turns at each place for its looks and back, rad; it may turn full circle."""
    turns = []
    for _, looks in groupby(chosen, key=lambda look: look[0]):
        angles = [0.0, *(turn for _, turn in looks)]
        turns.append(min(2.0 * (max(angles) - min(angles)), math.tau))
    return turns
